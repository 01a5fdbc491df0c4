"""Repaired traffic models: what discovery found out about drivers, as a file, and as traffic that drives by it."""

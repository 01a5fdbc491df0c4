"""Repaired traffic models: the drivers and effects that discovery has found, as a file and as simulated traffic."""

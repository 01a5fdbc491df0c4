"""Checks of canonical tables: what cannot be true of vehicles on a road, and what becomes of rows that fail."""

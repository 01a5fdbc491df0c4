"""Checks of canonical tables: rows that contradict the motion of vehicles on a road, and their removal."""

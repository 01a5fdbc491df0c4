"""Checks of canonical tables (see `data.schema`): rows that contradict the motion of vehicles, and their removal."""

"""Recordings in, canonical tables and scenes out; the only folder that reads trajectory files."""

"""Reads recordings into canonical tables and cuts scenes from them; the only folder that reads trajectory files."""

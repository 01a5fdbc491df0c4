"""Reads recordings into canonical tables (see `schema`) and cuts scenes; no other folder reads trajectory files."""

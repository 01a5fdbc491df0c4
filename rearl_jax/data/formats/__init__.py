"""Readers of published formats of recordings, which convert their files to canonical tables."""

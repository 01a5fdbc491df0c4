"""Scenes replayed on a page: simulated vehicles above recorded ones, second by second."""

"""Tracks to clusters of tracks, scenes to clusters of scenes, clusters to representative scenes."""

"""Clusters of tracks, clusters of scenes by the tracks in them, and representative scenes."""

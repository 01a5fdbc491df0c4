"""Tracks in a plane or on a network laid along one straight road."""

"""Conversion of tracks on a map, on a network or on a ring to positions along one straight road."""

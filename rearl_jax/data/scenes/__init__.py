"""Scenes of equal shape, cut from recordings: windows, vehicles, boundaries, splits, and files of them."""

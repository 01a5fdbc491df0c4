"""Baselines: other methods to control the vehicles, without comparison of the running traffic with recorded scenes."""

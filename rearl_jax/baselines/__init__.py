"""Baselines: other ways to drive the vehicles, which do not compare the running traffic with recorded scenes."""

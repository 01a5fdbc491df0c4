"""Baselines: other ways to drive the vehicles, trained or chosen without holding the traffic to recorded scenes."""

"""Baselines: methods that control vehicles without comparing the running traffic with recorded scenes."""

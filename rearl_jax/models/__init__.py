"""Repaired traffic models: the effects that discovery found and the drivers calibrated with them, as a file and as
simulated traffic.
"""

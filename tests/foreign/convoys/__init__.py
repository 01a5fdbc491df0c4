"""Instrumented convoys on a motorway: an independent generator of measured car-following, one effect at a time."""

from .dataset import FRAME_RATE, Dataset, effects, make

__all__ = ["FRAME_RATE", "Dataset", "effects", "make"]

"""Rows that are made or changed for a test."""

import numpy as np
import pandas as pd


def car_rows(
    track: int,
    position: np.ndarray,
    speed: np.ndarray | float,
    acceleration: np.ndarray | float,
    *,
    lane: int = 0,
    lane_width: float = 3.5,
    direction: int = 1,
) -> pd.DataFrame:
    """Canonical rows of a car that keeps to the middle of its lane, from frame 0 on."""
    across = lane_width * (lane + 0.5)
    return pd.DataFrame(
        {
            "track_id": track,
            "frame": np.arange(len(position)),
            "direction": direction,
            "x": position,
            "y": across,
            "position": position,
            "lateral": across,
            "lane": lane,
            "speed": speed,
            "acceleration": acceleration,
            "length": 4.5,
            "width": 1.8,
            "vehicle_class": "car",
        }
    )


def with_values(rows: pd.DataFrame, row: int, **values) -> pd.DataFrame:
    """The rows with other values of any type in one of them."""
    changed = rows.copy()
    for name, value in values.items():
        changed[name] = changed[name].astype(object)
        changed.loc[row, name] = value
    return changed

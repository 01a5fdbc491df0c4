"""Recordings drawn by hand, a vehicle at a time."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.data.records import Recording, RecordingInfo

RATE = 10.0


@pytest.fixture(scope="session")
def recording():
    """Vehicles (start [m], speed [m/s], lane or a function of time, class) for some seconds on lanes 0 (left) to 2."""

    def make(vehicles, seconds=12.0, lanes=True):
        time = np.arange(round(seconds * RATE) + 1) / RATE
        tables = []
        for track, (start, speed, lane, kind) in enumerate(vehicles, 1):
            on = np.array([lane(t) if callable(lane) else lane for t in time])
            tables.append(
                pd.DataFrame(
                    {
                        "track_id": track,
                        "frame": np.arange(len(time)),
                        "time": time,
                        "direction": np.int8(1),
                        "x": start + speed * time,
                        "y": 0.0,
                        "position": start + speed * time,
                        "lateral": 0.0,
                        "lane": pd.array(on if lanes else [pd.NA] * len(on), dtype="Int8"),
                        "speed": float(speed),
                        "acceleration": 0.0,
                        "length": 12.0 if kind == "truck" else 4.0,
                        "width": 2.0,
                        "vehicle_class": kind,
                        "leader_id": pd.array([pd.NA] * len(time), dtype="Int64"),
                    }
                )
            )
        info = RecordingInfo("scene", RATE, {1: 3}, 1000.0, "test", "CC0-1.0", "nobody", generated=True)
        return Recording(info, pd.concat(tables, ignore_index=True))

    return make

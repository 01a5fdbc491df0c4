"""Small recordings for the tests of the readers: a canonical table, and files in the highD format."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.data.made_rows import car_rows

UPPER, LOWER = "8.00;11.75;15.50", "20.00;23.75;27.50"  # two lanes of 3.75 m per direction
ROAD = 420.0


def make_highd_files(
    folder: Path, number: str = "01", *, n_vehicles: int = 12, n_frames: int = 150, seed: int = 0
) -> Path:
    """Path of NN_tracks.csv: vehicles of both directions at constant speed, the third of each changes lanes.

    Vehicle i (from 1) drives in direction 1 if i is odd, in laneId 2, 3 (upper) or 5, 6 (lower); every
    fourth is a truck. All numbers are rounded to centimetres as in highD.
    """
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    tracks, meta = [], []
    for i in range(1, n_vehicles + 1):
        direction, truck = (1 if i % 2 else 2), i % 4 == 0
        length, width = (14.0, 2.5) if truck else (4.6, 1.9)
        speed = rng.uniform(22.0, 26.0) if truck else rng.uniform(28.0, 36.0)
        frames = np.arange(n_frames) + 1 + 5 * i
        along = 10.0 + speed * np.arange(n_frames) / 25.0
        rank = np.full(n_frames, 1.0)
        if i % 3 == 0:  # from the right to the left lane
            rank = 1.0 - np.clip((np.arange(n_frames) - 50) / 60.0, 0.0, 1.0)
        lateral = 3.75 * (rank + 0.5)
        xc, yc = (ROAD - along, 15.5 - lateral) if direction == 1 else (along, 20.0 + lateral)
        lane = np.floor(lateral / 3.75).astype(int)
        tracks.append(
            pd.DataFrame(
                {
                    "frame": frames,
                    "id": i,
                    "x": np.round(xc - length / 2, 2),
                    "y": np.round(yc - width / 2, 2),
                    "width": length,
                    "height": width,
                    "xVelocity": round(speed, 2) * (1 if direction == 2 else -1),
                    "xAcceleration": 0.1 if direction == 2 else -0.1,
                    "laneId": 3 - lane if direction == 1 else 5 + lane,
                }
            )
        )
        kind = "Truck" if truck else "Car"
        meta.append({"id": i, "numFrames": n_frames, "class": kind, "drivingDirection": direction})
    _with_preceding(pd.concat(tracks, ignore_index=True)).to_csv(folder / f"{number}_tracks.csv", index=False)
    pd.DataFrame(meta).to_csv(folder / f"{number}_tracksMeta.csv", index=False)
    recording = {
        "id": int(number),
        "frameRate": 25,
        "locationId": 1,
        "speedLimit": 33.33,
        "upperLaneMarkings": UPPER,
        "lowerLaneMarkings": LOWER,
    }
    pd.DataFrame([recording]).to_csv(folder / f"{number}_recordingMeta.csv", index=False)
    return folder / f"{number}_tracks.csv"


def _with_preceding(tracks: pd.DataFrame) -> pd.DataFrame:
    """The tracks with the next vehicle ahead on the lane of each, 0 without one, as precedingId."""
    ahead = np.sign(tracks["xVelocity"]) * (tracks["x"] + tracks["width"] / 2)
    in_order = tracks.assign(ahead=ahead).sort_values(["frame", "laneId", "ahead"], kind="stable")
    by_lane = in_order.groupby(["frame", "laneId"])
    is_ahead = by_lane["ahead"].shift(-1) > in_order["ahead"] + 0.02  # vehicles side by side have no order
    preceding = by_lane["id"].shift(-1, fill_value=0).where(is_ahead, 0)
    place = tracks.columns.get_loc("laneId")
    return tracks.assign(precedingId=preceding)[[*tracks.columns[:place], "precedingId", *tracks.columns[place:]]]


@pytest.fixture
def highd_files() -> Callable[..., Path]:
    return make_highd_files


@pytest.fixture
def vehicle_rows() -> pd.DataFrame:
    """Three vehicles, 100 frames at 10 per second: 1 and 2 in lanes 0 and 1, the truck 3 follows 1."""
    time = np.arange(100) / 10.0
    vehicles = ((1, 0, 60.0, 20.0), (2, 1, 40.0, 22.0), (3, 0, 20.0, 18.0))
    first, second, last = (
        car_rows(track, start + speed * time, speed, 0.0, lane=lane) for track, lane, start, speed in vehicles
    )
    truck = last.assign(length=12.0, width=2.5, vehicle_class="truck", leader_id=1.0)
    rows = pd.concat([first, second, truck], ignore_index=True)
    return rows.assign(frame=rows["frame"] + 7)


@pytest.fixture
def timed_rows(vehicle_rows) -> pd.DataFrame:
    """The same rows with their times [s]."""
    return vehicle_rows.assign(time=vehicle_rows["frame"] / 10.0)

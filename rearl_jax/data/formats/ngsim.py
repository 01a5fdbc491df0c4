"""Reader of the shipped NGSIM table: US-101, lane-changing vehicles, SI units.

NGSIM gives the position of the middle of a vehicle's front, the canonical table that of its centre.

Source: U.S. Department of Transportation, Next Generation Simulation Vehicle Trajectories and Supporting
Data, DOI 10.21949/1504477.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import median_filter

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.files.columnar import column_names, read_columns
from rearl_jax.data.problems import Finding, bad_recording, require_columns
from rearl_jax.data.schema import Recording, RecordingInfo, validate

FRAME_RATE = 10.0
LICENCE = "CC BY-SA 4.0"
ATTRIBUTION = (
    "U.S. Department of Transportation Federal Highway Administration (2016), Next Generation Simulation "
    "(NGSIM) Vehicle Trajectories and Supporting Data, https://doi.org/10.21949/1504477"
)
# Source: NGSIM data descriptions. Lane 1 is the leftmost. US-101 has the lanes 1 to 5, the auxiliary lane 6, the
# on-ramp 7 and the off-ramp 8; I-80 has the lanes 1 to 6 and the on-ramp 7.
LANES = {"us101": 8, "i80": 7}
"""Number of lanes of each highway, with the ramps."""
CLASSES = {1: "motorcycle", 2: "car", 3: "truck"}
"""Vehicle classes by their number in NGSIM. Source: I-80 data description."""
US101_LENGTH = 640.0  # m, 2100 ft; NGSIM US-101 data description
MEDIAN_WINDOW = 21  # frames, 2 s
_MAX_LANE = 100  # larger values are not lane numbers

_US101_PERIODS = {0: "us101_0750", 1: "us101_0805", 2: "us101_0820"}
_US101_COLUMNS = ("period", "vehicle_id", "frame", "x_m", "y_m", "lane_est", "speed_mps", "accel_mps2")
US101_COLUMNS = (*_US101_COLUMNS, "total_frames", "global_time_ms")
"""Columns by which a file is recognised."""
# Columns of the file by canonical name, so that messages name the columns as the file does.
_US101_SPELLING = {
    "track_id": "vehicle_id",
    "x": "y_m",
    "y": "x_m",
    "position": "y_m",
    "lateral": "x_m",
    "lane": "lane_est",
    "speed": "speed_mps",
    "acceleration": "accel_mps2",
}


def us101_recordings(path: Path) -> dict[str, int]:
    """Periods of the shipped table by the id of the recording that is read from them."""
    require_columns(column_names(path), _US101_COLUMNS, path)
    periods = read_columns(path, ("period",))["period"].unique().tolist()
    unknown = [period for period in periods if period not in _US101_PERIODS]
    if unknown or not periods:
        text = f"the period is {unknown[0]}" if unknown else "the table has no rows"
        remedy = f"write one of {', '.join(map(str, _US101_PERIODS))}"
        raise bad_recording("period-unknown", text, remedy, path, column="period")
    return {_US101_PERIODS[period]: period for period in sorted(periods)}


def read_us101(path: Path, recording: str, period: int, policy: DataConfig) -> Recording:
    """One period of the SI table of US-101 lane changers.

    Lanes are the running median of `lane_est` over 2 s. The source derives `lane_est` from the lateral position, so it
    changes too often while a vehicle is near a lane marking.
    """
    rows = read_columns(path, _US101_COLUMNS, only=("period", period))
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: 6},
        road_length=US101_LENGTH,
        source="NGSIM US-101, 370 lane-changing vehicles",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        notes=(
            "only vehicles that change lanes, about a tenth of the traffic: neither density nor lane-change rate of "
            "the road can be derived from them",
            f"length and class are not in the table: {policy.default_length:g} m and car are assumed for all",
            "lanes derived from the lateral position, running median over 2 s; lane 5, counted from 0, is auxiliary",
            "accelerations are clipped at 3.45 m/s^2 in the source",
        ),
        file=f"{path} (period {period})",
        columns=_US101_SPELLING,
    )
    position = rows["y_m"].to_numpy(dtype=np.float64) - 0.5 * policy.default_length
    lateral = rows["x_m"].to_numpy(dtype=np.float64)
    table = pd.DataFrame(
        {
            "track_id": rows["vehicle_id"].to_numpy(),
            "frame": rows["frame"].to_numpy(),
            "direction": 1,
            "x": position,
            "y": lateral,
            "position": position,
            "lateral": lateral,
            "lane": rows["lane_est"].to_numpy(dtype=np.float64) - 1.0,
            "speed": rows["speed_mps"].to_numpy(dtype=np.float64),
            "acceleration": rows["accel_mps2"].to_numpy(dtype=np.float64),
            "length": policy.default_length,
            "vehicle_class": "car",
        }
    )
    losses = Losses()
    unknown = ~(np.abs(table["lane"].to_numpy()) < _MAX_LANE)
    finding = Finding("not_finite", "lane", unknown, "the lane is unknown", "complete the row")
    table = reject(table, finding, info, policy, losses)
    table = table.assign(lane=debounced(table["lane"].to_numpy(), table["track_id"].to_numpy()))
    return Recording(info, *validate(table, info, policy, losses))


def debounced(lane: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Running median of the lane over 2 s within each track; at its ends the track is mirrored."""
    borders = np.flatnonzero(track[1:] != track[:-1]) + 1
    parts = np.split(lane.astype(np.int64), borders)
    return np.concatenate([median_filter(part, size=MEDIAN_WINDOW, mode="reflect") for part in parts])

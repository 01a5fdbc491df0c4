"""Reader of the shipped NGSIM table: US-101, lane-changing vehicles, SI units.

NGSIM gives the front centre of a vehicle, the canonical table wants the centre.

Source: U.S. Department of Transportation, Next Generation Simulation Vehicle Trajectories and Supporting
Data, DOI 10.21949/1504477.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from scipy.ndimage import median_filter

from rearl_jax.config.data import DataConfig
from rearl_jax.data.problems import require_columns
from rearl_jax.data.schema import Recording, RecordingInfo, validate

FRAME_RATE = 10.0
LICENCE = "CC BY-SA 4.0"
ATTRIBUTION = (
    "U.S. Department of Transportation Federal Highway Administration (2016), Next Generation Simulation "
    "(NGSIM) Vehicle Trajectories and Supporting Data, https://doi.org/10.21949/1504477"
)
US101_LENGTH = 640.0  # m, 2100 ft; NGSIM US-101 data description
DEBOUNCE = 21  # frames, 2 s

_US101_PERIODS = {0: "us101_0750", 1: "us101_0805", 2: "us101_0820"}
_US101_COLUMNS = ("period", "vehicle_id", "frame", "x_m", "y_m", "lane_est", "speed_mps", "accel_mps2")
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
    """Recording id -> period of the shipped table."""
    require_columns(pq.read_schema(path).names, _US101_COLUMNS, str(path))
    periods = pq.read_table(path, columns=["period"])["period"].unique().to_pylist()
    return {_US101_PERIODS[period]: period for period in sorted(periods)}


def read_us101(path: Path, recording: str, period: int, policy: DataConfig) -> Recording:
    """One period of the SI table of US-101 lane changers.

    Lane ranks come from `lane_est`, a function of the lateral position that flickers at lane borders, after a
    running median over 2 s.
    """
    rows = pq.read_table(path, columns=list(_US101_COLUMNS), filters=[("period", "=", period)]).to_pandas()
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: 6},
        road_length=US101_LENGTH,
        source="NGSIM US-101, 370 lane-changing vehicles",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        notes=(
            "only vehicles that change lanes, about a tenth of the traffic: it tells neither density nor "
            "lane-change rate of the road",
            f"length and class are not in the table: {policy.default_length:g} m and car are assumed for all",
            "lane ranks from the lateral position, running median over 2 s; rank 5 is the auxiliary lane",
            "accelerations are clipped at 3.45 m/s^2 in the source",
        ),
        file=f"{path} (period {period})",
        columns=_US101_SPELLING,
    )
    position = rows["y_m"].to_numpy(dtype=np.float64) - 0.5 * policy.default_length
    lateral = rows["x_m"].to_numpy(dtype=np.float64)
    track = rows["vehicle_id"].to_numpy()
    table = pd.DataFrame(
        {
            "track_id": track,
            "frame": rows["frame"].to_numpy(),
            "direction": 1,
            "x": position,
            "y": lateral,
            "position": position,
            "lateral": lateral,
            "lane": debounced(rows["lane_est"].to_numpy(), track) - 1,
            "speed": rows["speed_mps"].to_numpy(dtype=np.float64),
            "acceleration": rows["accel_mps2"].to_numpy(dtype=np.float64),
            "length": policy.default_length,
            "vehicle_class": "car",
        }
    )
    table, dropped = validate(table, info, policy)
    return Recording(info, table, dropped)


def debounced(lane: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Running median of the lane over 2 s within each track, mirrored at its ends."""
    borders = np.flatnonzero(np.diff(track)) + 1
    parts = np.split(lane.astype(np.int64), borders)
    return np.concatenate([median_filter(part, size=DEBOUNCE, mode="reflect") for part in parts])

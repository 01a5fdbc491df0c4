"""Figures of a set of recordings in the highD format, to hold beside the published totals of highD."""

from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.problems import MissingInputError, Problem

WINDOW = 60  # seconds of a scene and its number of snapshots
SCENE_VEHICLES = 10  # fewest vehicles in every snapshot of a scene (Bi et al.)


def summarise(root: Path) -> pd.DataFrame:
    """One row per recording, read from the meta files alone; index = number of the recording.

    Columns: duration [s], n_lanes per direction, n_vehicles, truck_share, in_view (mean number of vehicles),
    car_speed, car_speed_sd, truck_speed, truck_speed_sd (of the vehicles' mean speeds [m/s]), crossing_time
    (mean time in view [s]), lane_changes, lane_change_rate [1/s per vehicle], n_windows (60 s, not
    overlapping, from the first frame) and n_scenes (windows with at least ten vehicles in each of the 60
    snapshots).

    Raises:
        FileNotFoundError: No recording in the folder.
    """
    paths = sorted(root.glob("*_recordingMeta.csv"))
    if not paths:
        said = "no *_recordingMeta.csv in this folder: name the folder of the recordings"
        raise MissingInputError(Problem("recordings-missing", said, file=str(root)))
    rows = [_recording(path, path.with_name(path.name.replace("recordingMeta", "tracksMeta"))) for path in paths]
    return pd.DataFrame(rows).set_index("id").sort_index()


def totals(summary: pd.DataFrame) -> dict[str, int | float]:
    """Figures of the whole set: sums, means over recordings and the range over recordings."""
    time_in_view = float((summary.in_view * summary.duration).sum())
    return {
        "n_recordings": len(summary),
        "hours": float(summary.duration.sum()) / 3600.0,
        "n_vehicles": int(summary.n_vehicles.sum()),
        "n_vehicles_min": int(summary.n_vehicles.min()),
        "n_vehicles_max": int(summary.n_vehicles.max()),
        "truck_share_min": float(summary.truck_share.min()),
        "truck_share_mean": float(summary.truck_share.mean()),
        "truck_share_max": float(summary.truck_share.max()),
        "in_view_min": float(summary.in_view.min()),
        "in_view_mean": float(summary.in_view.mean()),
        "in_view_max": float(summary.in_view.max()),
        "crossing_time": time_in_view / float(summary.n_vehicles.sum()),
        "car_speed": float(np.average(summary.car_speed, weights=summary.n_vehicles)),
        "car_speed_sd": float(np.average(summary.car_speed_sd, weights=summary.n_vehicles)),
        "truck_speed": float(np.average(summary.truck_speed, weights=summary.n_vehicles * summary.truck_share)),
        "truck_speed_sd": float(np.average(summary.truck_speed_sd, weights=summary.n_vehicles * summary.truck_share)),
        "lane_changes": int(summary.lane_changes.sum()),
        "lane_change_rate": float(summary.lane_changes.sum()) / time_in_view,
        "n_windows": int(summary.n_windows.sum()),
        "n_scenes": int(summary.n_scenes.sum()),
    }


def _recording(recording_path: Path, tracks_path: Path) -> dict[str, int | float]:
    meta = pd.read_csv(recording_path).to_dict("records")[0]
    tracks = pd.read_csv(tracks_path)
    frame_rate = round(meta["frameRate"])
    n_frames = round(meta["duration"] * frame_rate)
    frames = np.arange(n_frames + 2)
    entered = np.searchsorted(np.sort(tracks["initialFrame"]), frames, side="right")
    left = np.searchsorted(np.sort(tracks["finalFrame"]), frames, side="left")
    in_view = (entered - left)[1 : n_frames + 1]
    n_windows = n_frames // (WINDOW * frame_rate)
    snapshots = in_view[: n_windows * WINDOW * frame_rate : frame_rate].reshape(n_windows, WINDOW)
    n_rows = int(tracks["numFrames"].to_numpy().sum())
    changes = int(tracks["numLaneChanges"].to_numpy().sum())
    speed, is_truck = tracks["meanXVelocity"].to_numpy(), tracks["class"].to_numpy() == "Truck"
    car_speed, car_speed_sd = _mean_and_sd(speed[~is_truck])
    truck_speed, truck_speed_sd = _mean_and_sd(speed[is_truck])
    return {
        "id": int(meta["id"]),
        "duration": float(meta["duration"]),
        "n_lanes": meta["upperLaneMarkings"].count(";"),
        "n_vehicles": int(meta["numVehicles"]),
        "truck_share": float(meta["numTrucks"] / meta["numVehicles"]),
        "in_view": float(in_view.mean()),
        "car_speed": car_speed,
        "car_speed_sd": car_speed_sd,
        "truck_speed": truck_speed,
        "truck_speed_sd": truck_speed_sd,
        "crossing_time": n_rows / len(tracks) / frame_rate,
        "lane_changes": changes,
        "lane_change_rate": changes / n_rows * frame_rate,
        "n_windows": n_windows,
        "n_scenes": int((snapshots.min(axis=1) >= SCENE_VEHICLES).sum()),
    }


def _mean_and_sd(values: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation; NaN for fewer than two values."""
    if len(values) < 2:
        return float("nan"), float("nan")
    return float(values.mean()), float(values.std(ddof=1))

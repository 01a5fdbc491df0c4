"""Shares of aggressive drivers, defensive drivers and trucks among the vehicles of recordings.

Every vehicle in given parts of the recordings counts, not only the vehicles picked for scenes, which are those longest
in view and thus too often slow.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.data.records import Recording
from rearl_jax.problems import InvalidInputError, Problem

N_GROUPS = 3
"""Groups of cars. Source: CRITICAL, HIGHD.py."""


@dataclass(frozen=True)
class Stretch:
    """Part of a recording.

    Attributes:
        first: First frame of the part.
        stop: Frame after the last frame of the part.
        direction: Carriageway that is used; None for both.
    """

    first: int
    stop: int
    direction: int | None = None


@dataclass(frozen=True)
class Driving:
    """Statistics of driving, one entry per vehicle.

    Attributes:
        speed: Mean speed [m/s].
        acceleration: Mean absolute change of speed per second, over the whole number of frames nearest to one second
            [m/s^2], because some recordings have no accelerations and others only noisy ones.
        lane_changes: Number of lane changes; 0 if lanes are unknown.
        is_truck: Whether the data source classifies the vehicle as a truck.
    """

    speed: Float[np.ndarray, " vehicles"]
    acceleration: Float[np.ndarray, " vehicles"]
    lane_changes: Int[np.ndarray, " vehicles"]
    is_truck: Bool[np.ndarray, " vehicles"]


def driving_of(recordings: Iterable[Recording], stretches: Mapping[str, Sequence[Stretch]]) -> Driving:
    """Statistics of every car and truck in view for a second or more in some parts of the recordings.

    A vehicle in several parts of one recording is one entry.

    Args:
        recordings: The recordings, one in memory at a time.
        stretches: Parts by id of the recording; recordings without an entry are skipped.
    """
    parts = [_of_recording(rec, stretches[rec.info.id]) for rec in recordings if rec.info.id in stretches]
    return Driving(
        **{item.name: np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(Driving)}
    )


def _of_recording(recording: Recording, stretches: Sequence[Stretch]) -> Driving:
    table = recording.table
    frame, direction = table["frame"].to_numpy(), table["direction"].to_numpy()
    wanted = np.zeros(len(table), bool)
    for stretch in stretches:
        on_carriageway = True if stretch.direction is None else direction == stretch.direction
        wanted |= (frame >= stretch.first) & (frame < stretch.stop) & on_carriageway
    is_car, is_truck = (table["vehicle_class"].eq(name).to_numpy() for name in ("car", "truck"))
    rows = np.flatnonzero(wanted & (is_car | is_truck))
    _, first, vehicle = np.unique(table["track_id"].to_numpy()[rows], return_index=True, return_inverse=True)
    frame, speed = frame[rows], table["speed"].to_numpy(np.float64)[rows]
    lane = table["lane"].to_numpy(np.float64, na_value=np.nan)[rows]
    n_vehicles = len(first)

    def rows_before(n_frames: int) -> np.ndarray:
        """Indices of the rows whose vehicle also has a row exactly `n_frames` frames later."""
        if len(vehicle) <= n_frames:
            return np.zeros(0, np.int64)
        return np.flatnonzero(
            (vehicle[n_frames:] == vehicle[:-n_frames]) & (frame[n_frames:] - frame[:-n_frames] == n_frames)
        )

    lag = max(1, round(recording.info.frame_rate))  # frames
    duration = lag / recording.info.frame_rate  # a second, unless the frame rate is no whole number
    pairs, steps = rows_before(lag), rows_before(1)
    n_pairs = np.bincount(vehicle[pairs], minlength=n_vehicles)
    change = np.bincount(vehicle[pairs], np.abs(speed[pairs + lag] - speed[pairs]) / duration, n_vehicles)
    before, after = lane[steps], lane[steps + 1]
    changed = steps[np.isfinite(before) & np.isfinite(after) & (before != after)]
    has_pairs = n_pairs > 0
    return Driving(
        speed=(np.bincount(vehicle, speed, n_vehicles) / np.bincount(vehicle, minlength=n_vehicles))[has_pairs],
        acceleration=change[has_pairs] / n_pairs[has_pairs],
        lane_changes=np.bincount(vehicle[changed], minlength=n_vehicles)[has_pairs],
        is_truck=is_truck[rows[first]][has_pairs],
    )


def recorded_mixture(driving: Driving) -> Mixture:
    """The shares of the recorded vehicles: trucks as their source names them, cars in three groups.

    Groups: k-means on speed, acceleration and lane changes, each standardised (mean 0, standard deviation 1). The
    slowest group is defensive; of the other two groups, the group whose centre has the larger sum (fast and active) is
    aggressive, the other regular.

    Raises:
        InvalidInputError: There are fewer than three different cars.

    Source: CRITICAL, HIGHD.py (k-prototypes on speed, acceleration and lane changes); the order of the groups is ours.
    """
    cars = ~driving.is_truck
    columns = (driving.speed, driving.acceleration, driving.lane_changes)
    features = np.stack([column[cars] for column in columns], axis=1).astype(np.float64)
    if (n_different := len(np.unique(features, axis=0))) < N_GROUPS:
        message = f"{N_GROUPS} kinds of drivers need {N_GROUPS} cars that drive differently; the threshold scenes have "
        message += f"{n_different} among {len(features)} cars"
        remedy = "set critical.ratios=[AGGRESSIVE,DEFENSIVE,TRUCK] or critical.proposer=search"
        raise InvalidInputError(Problem("cars-too-few", message, remedy))
    spread = features.std(axis=0)
    scaled = (features - features.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    # Imported here, because scikit-learn is slow to import and most methods do not need it.
    from sklearn.cluster import KMeans

    groups = KMeans(N_GROUPS, n_init=10, random_state=0)  # pyright: ignore[reportArgumentType]
    labels, centres = groups.fit_predict(scaled), groups.cluster_centers_
    slowest = int(centres[:, 0].argmin())
    activity = np.where(np.arange(N_GROUPS) == slowest, -np.inf, centres.sum(axis=1))
    n_cars = np.bincount(labels, minlength=N_GROUPS)
    counts = (n_cars[activity.argmax()], n_cars[slowest], (~cars).sum())
    return Mixture(*(float(count / len(cars)) for count in counts))

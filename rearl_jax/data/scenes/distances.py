"""Distances between vehicles that are recorded at the same frame.

Arrays are (cells, places): one row per cell, a snapshot of the vehicles of a scene, and one column per vehicle, padded
to the largest number of vehicles; `present` marks the places with a vehicle.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.config.scenes import FeatureDistance, SpacingMetric
from rearl_jax.problems import InvalidInputError, Problem

# Pairs held at once; bounds the memory of a distance matrix to some 100 MB.
_MAX_PAIRS = 4_000_000


@dataclass(frozen=True)
class Vehicles:
    """Columns of a canonical table, one value per row.

    Attributes:
        x: Centre in the common ground frame, along the road [m].
        y: Centre in the common ground frame, across the road [m].
        position: Centre along its driving direction [m].
        length: Vehicle length [m].
        speed: Speed along the driving direction [m/s].
        direction: Carriageway, 1 or 2.
        lane: Lane, 0 = leftmost in driving direction; negative where unknown.
    """

    x: np.ndarray
    y: np.ndarray
    position: np.ndarray
    length: np.ndarray
    speed: np.ndarray
    direction: np.ndarray
    lane: np.ndarray


def feature_distance(
    vehicles: Vehicles,
    rows: np.ndarray,
    present: np.ndarray,
    n_places: int,
    definition: FeatureDistance,
    metric: SpacingMetric,
) -> np.ndarray:
    """Feature distance d of the first `n_places` vehicles of every cell [m]: the mean distance to all others, or the
    distance to the vehicle ahead. `rows` holds the table row of the vehicle in every place.

    Source: Bi et al. use the letter d for the mean distance to the others and in the feature vector, where it could
    also mean the distance headway.
    """
    if definition is FeatureDistance.dhw:
        return distance_headway(vehicles, rows, present, n_places)
    return mean_distance(vehicles.x[rows], vehicles.y[rows], present, n_places, metric)


def mean_distance(
    x: np.ndarray, y: np.ndarray, present: np.ndarray, n_places: int, metric: SpacingMetric
) -> np.ndarray:
    """Mean distance of the first `n_places` centres to all other present centres [m]; NaN without another.

    d_i = 1/(n-1) sum_{j != i} |r_i - r_j|; `longitudinal` replaces the norm by |x_i - x_j|.

    Source: Bi et al., mean spacing.
    """
    result = np.empty((len(x), n_places))
    for part in _parts(len(x), n_places * x.shape[1]):
        distance = np.abs(x[part, :n_places, None] - x[part, None, :])
        if metric is SpacingMetric.euclid2d:
            distance = np.hypot(distance, y[part, :n_places, None] - y[part, None, :])
        # A vehicle's distance to itself is 0 and drops out of the sum.
        total = np.where(present[part, None, :], distance, 0.0).sum(axis=2)
        n_others = present[part].sum(axis=1, keepdims=True) - 1
        result[part] = np.where(n_others > 0, total / np.maximum(n_others, 1), np.nan)
    return result


def distance_headway(vehicles: Vehicles, rows: np.ndarray, present: np.ndarray, n_places: int) -> np.ndarray:
    """Distance from the front bumper to the rear bumper of the nearest vehicle ahead in the lane [m].

    0 without a vehicle ahead, as in highD's column `dhw`, and if the two overlap.

    Raises:
        ValueError: A vehicle's lane is unknown.

    Source: highD format, column dhw.
    """
    if (vehicles.lane[rows][present] < 0).any():
        message = "is dhw, which needs lanes, but a recording has vehicles without one: set features.d=mean_all"
        raise InvalidInputError(Problem("lane-missing", message, key="features.d"))
    result = np.empty((len(rows), n_places))
    for part in _parts(len(rows), n_places * rows.shape[1]):
        vehicle, other = rows[part, :n_places, None], rows[part, None, :]
        ahead = vehicles.position[other] - vehicles.position[vehicle]
        gap = ahead - 0.5 * (vehicles.length[vehicle] + vehicles.length[other])
        same_lane = (vehicles.lane[other] == vehicles.lane[vehicle]) & (
            vehicles.direction[other] == vehicles.direction[vehicle]
        )
        is_leader = present[part, None, :] & same_lane & (ahead > 0)
        # The nearest centre, not the smallest gap: a long truck further ahead is not the leader.
        leader = np.argmin(np.where(is_leader, ahead, np.inf), axis=2)
        nearest = np.take_along_axis(gap, leader[:, :, None], axis=2)[:, :, 0]
        result[part] = np.where(is_leader.any(axis=2), np.maximum(nearest, 0.0), 0.0)
    return result


def _parts(n_cells: int, pairs_per_cell: int) -> list[slice]:
    """Consecutive groups of cells with at most about _MAX_PAIRS pairs each."""
    step = max(1, _MAX_PAIRS // max(1, pairs_per_cell))
    return [slice(start, start + step) for start in range(0, n_cells, step)]

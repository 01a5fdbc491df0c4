"""Ramp lanes: lanes that exist on part of the road only; changes from and to them are mandatory."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.data.records import Recording

WHOLE_LANE = 0.8
"""Share of the road that a through lane must cover [-]; other lanes are ramp lanes."""

Lanes = set[tuple[int, int]]
"""Directions and lanes."""


def whole_lanes(
    direction: Int[np.ndarray, " rows"], lane: Int[np.ndarray, " rows"], position: Float[np.ndarray, " rows"]
) -> Lanes:
    """Directions and lanes that cover most of the road; positions in m."""
    spans = {}
    for way, lane_number in np.unique(np.stack([direction, lane]), axis=1).T.tolist():
        spans[way, lane_number] = np.ptp(position[(direction == way) & (lane == lane_number)])
    road = {way: max(span for (of_way, _), span in spans.items() if of_way == way) for way, _ in spans}
    return {key for key, span in spans.items() if span >= WHOLE_LANE * road[key[0]]}


def side_of_ramp(
    vehicle: Int[np.ndarray, " rows"],
    direction: Int[np.ndarray, " rows"],
    lane: Int[np.ndarray, " rows"],
    whole: Lanes,
) -> Int[np.ndarray, " rows"]:
    """Side of the next ramp lane that the vehicle reaches later: -1 left, +1 right, 0 for none.

    Args:
        vehicle: Vehicle of each row; rows of one vehicle are consecutive in time.
        direction, lane: Driving direction and lane of each row.
        whole: Through lanes.
    """
    n, row = len(vehicle), np.arange(len(vehicle))
    on_ramp = ~_are_in(direction, lane, whole)
    later = np.minimum.accumulate(np.where(on_ramp, row, n)[::-1])[::-1] if n else row
    reached = np.minimum(later, n - 1)
    goes_there = (later < n) & (vehicle[reached] == vehicle)
    return np.where(goes_there, np.sign(lane[reached] - lane), 0)


def count_ramp_changes(recordings: Sequence[Recording]) -> int:
    """Number of recorded lane changes from or to a ramp lane."""
    n_changes = 0
    for recording in recordings:
        table = recording.table.loc[recording.table["lane"].notna()]
        lane, direction = table["lane"].to_numpy(np.int64), table["direction"].to_numpy(np.int64)
        on_ramp = ~_are_in(direction, lane, whole_lanes(direction, lane, table["position"].to_numpy()))
        track = table["track_id"].to_numpy()
        changed = (track[1:] == track[:-1]) & (lane[1:] != lane[:-1])
        n_changes += int((changed & (on_ramp[1:] | on_ramp[:-1])).sum())
    return n_changes


def _are_in(direction: np.ndarray, lane: np.ndarray, whole: Lanes) -> np.ndarray:
    """True for rows on a through lane."""
    known = np.zeros(len(lane), bool)
    for way, lane_number in whole:
        known |= (direction == way) & (lane == lane_number)
    return known

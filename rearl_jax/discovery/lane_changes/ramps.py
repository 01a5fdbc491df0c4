"""Ramp lanes: lanes that exist on part of the road only; changes from and to them are mandatory."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.data.records import Recording
from rearl_jax.data.vehicle_rows import follows_row_before, lane_steps

WHOLE_LANE = 0.8
"""Share of the road that a through lane must cover [-]; other lanes are ramp lanes."""

Lanes = set[tuple[int, int]]
"""Pairs of direction and lane."""


def whole_lanes(
    direction: Int[np.ndarray, " rows"], lane: Int[np.ndarray, " rows"], position: Float[np.ndarray, " rows"]
) -> Lanes:
    """Through lanes: directions and lanes that cover most of the road; positions in m."""
    spans = {}
    for way, lane_number in np.unique(np.stack([direction, lane]), axis=1).T.tolist():
        spans[way, lane_number] = np.ptp(position[(direction == way) & (lane == lane_number)])
    road_length = {way: max(span for (of_way, _), span in spans.items() if of_way == way) for way, _ in spans}
    return {(way, lane_number) for (way, lane_number), span in spans.items() if span >= WHOLE_LANE * road_length[way]}


def side_of_ramp(
    vehicle: Int[np.ndarray, " rows"],
    direction: Int[np.ndarray, " rows"],
    lane: Int[np.ndarray, " rows"],
    whole: Lanes,
) -> Int[np.ndarray, " rows"]:
    """Side of the next ramp lane that the vehicle of each row reaches later: -1 left, +1 right, 0 for none. Rows of one
    vehicle are consecutive in time; `whole` are the through lanes.
    """
    n, row = len(vehicle), np.arange(len(vehicle))
    on_ramp = ~_on_through_lane(direction, lane, whole)
    # The first row on a ramp from each row on, n if there is none.
    next_on_ramp = np.minimum.accumulate(np.where(on_ramp, row, n)[::-1])[::-1] if n else row
    reached = np.minimum(next_on_ramp, n - 1)
    goes_there = (next_on_ramp < n) & (vehicle[reached] == vehicle)
    return np.where(goes_there, np.sign(lane[reached] - lane), 0)


def count_ramp_changes(recordings: Sequence[Recording]) -> int:
    """Number of recorded lane changes from or to a ramp lane."""
    n_changes = 0
    for recording in recordings:
        table = recording.table.loc[recording.table["lane"].notna()]
        lane, direction = table["lane"].to_numpy(np.int64), table["direction"].to_numpy(np.int64)
        on_ramp = ~_on_through_lane(direction, lane, whole_lanes(direction, lane, table["position"].to_numpy()))
        track = table["track_id"].to_numpy()
        changed = lane_steps(lane, follows_row_before(track))[1:] != 0.0
        n_changes += int((changed & (on_ramp[1:] | on_ramp[:-1])).sum())
    return n_changes


def _on_through_lane(direction: np.ndarray, lane: np.ndarray, whole: Lanes) -> np.ndarray:
    """True for rows on a through lane."""
    is_through = np.zeros(len(lane), bool)
    for way, lane_number in whole:
        is_through |= (direction == way) & (lane == lane_number)
    return is_through

"""Vehicles ahead and behind on the own and the adjacent lanes, as rows of a table."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Int

from rearl_jax.core.order import NO_VEHICLE

_LANES = 64
"""Stride of lane numbers: more lanes than any carriageway has, with room for adjacent lanes."""


@dataclass(frozen=True)
class Pair:
    """The next vehicles on one lane, as rows of the table, NO_VEHICLE where there is none."""

    leader: Int[np.ndarray, " rows"]
    rear: Int[np.ndarray, " rows"]


def next_on_lanes(table: pd.DataFrame) -> dict[int, Pair]:
    """The next vehicles of every row on the lane to the left (-1), the own one (0) and that to the right (+1).

    Args:
        table: Rows with `frame`, `direction`, `lane` (none unknown) and `position`.
    """
    frame = table["frame"].to_numpy()
    position = table["position"].to_numpy()
    # One number per frame, direction and lane; adjacent lanes have adjacent numbers, and directions are below 4.
    lane_key = (frame - frame.min()) * 4 + table["direction"].to_numpy(np.int64)
    lane_key = lane_key * _LANES + table["lane"].to_numpy(np.int64) + 1
    # One sortable number per row: rank of its lane key times more than the road length, plus position; ranks are small,
    # so the sum is exact.
    lane_keys = np.unique(lane_key)
    span = float(np.ptp(position)) + 1.0
    along = position - position.min()
    order = np.lexsort((position, lane_key))
    sorted_numbers = np.searchsorted(lane_keys, lane_key)[order] * span + along[order]
    pairs = {}
    for side in (-1, 0, 1):
        rank = np.searchsorted(lane_keys, lane_key + side)
        exists = (rank < len(lane_keys)) & (lane_keys[np.minimum(rank, len(lane_keys) - 1)] == lane_key + side)
        number = rank * span + along
        ahead = np.searchsorted(sorted_numbers, number, side="right" if side == 0 else "left")  # not the row itself
        behind = np.searchsorted(sorted_numbers, number, side="left") - 1
        pairs[side] = Pair(*(_row_at(place, order, lane_key, lane_key + side, exists) for place in (ahead, behind)))
    return pairs


def _row_at(
    place: np.ndarray, order: np.ndarray, lane_key: np.ndarray, wanted_key: np.ndarray, exists: np.ndarray
) -> Int[np.ndarray, " rows"]:
    """Rows at given places of the sorted order; NO_VEHICLE if a row has another lane key than the wanted one, or no row
    has that key (`exists`).
    """
    inside = exists & (place >= 0) & (place < len(order))
    row = order[np.clip(place, 0, len(order) - 1)]
    return np.where(inside & (lane_key[row] == wanted_key), row, NO_VEHICLE)

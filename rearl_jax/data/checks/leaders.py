"""Leaders that a source states: which ids mean no leader, whether each can be a leader, and whether all are stated."""

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.placeholders import is_placeholder
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_rows import ABSENT, VehicleRows

LANE_CHANGE = 1.0
"""Longest time for which a stated leader may be in another lane [s], because lane and leader change separately."""

BESIDE = 2.5
"""Lateral distance [m] from which a leader drives beside its follower, where their lanes are not known: more than the
vehicles of one lane keep, less than most lanes are wide.
"""

COMPLETE_SHARE = 0.5
"""Share of the rows with a vehicle ahead in the lane that must have a stated leader for all leaders to count as stated.

In tables of leader-follower pairs it is 0.70 (NGSIM I-80 with lateral positions) or more, not 1, because the leader of
a pair has no leader in the table.
"""


def is_absent(leader: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Mask of the ids of leaders that are 0, -1 or another placeholder, and the id of no vehicle."""
    return ((leader == 0.0) | is_placeholder(leader)) & ~np.isin(leader, track)


def without_absent(
    leader: np.ndarray, *, track: np.ndarray, frame: np.ndarray, lane: np.ndarray, position: np.ndarray
) -> np.ndarray:
    """Ids of leaders as float64, NaN for 0, -1 or another placeholder that is the id of no vehicle.

    The formats write 0 where there is no leader. If a vehicle has the id 0, it is the leader of the vehicles behind it
    in its lane that state 0; for other rows 0 means no leader. Lanes of the two carriageways must have different
    numbers, and positions must rise in driving direction.
    """
    leader = leader.astype(np.float64)
    is_none = is_absent(leader, track)
    rows, zero = np.flatnonzero(leader == 0.0), np.flatnonzero(track == 0)
    if rows.size and zero.size:
        zero = zero[np.argsort(frame[zero], kind="stable")]
        found = zero[np.minimum(np.searchsorted(frame[zero], frame[rows]), len(zero) - 1)]
        is_ahead = (frame[found] == frame[rows]) & (lane[found] == lane[rows]) & (position[found] > position[rows])
        is_none[rows[~is_ahead]] = True
    return np.where(is_none, np.nan, leader)


def wrong_leader(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Finding of rows whose leader is the vehicle itself, behind it, on the other carriageway or in another lane."""
    track = table["track_id"].to_numpy()
    leader = VehicleRows(table).leaders(table)
    stated = leader != ABSENT
    if not stated.any():
        return None
    # A row without leader is compared with itself, which none of the checks below marks.
    other = np.where(stated, leader, np.arange(len(table)))
    direction, position = table["direction"].to_numpy(), table["position"].to_numpy()
    itself = stated & (track[other] == track)
    causes = {
        "itself": itself,
        "on the other carriageway": direction[other] != direction,
        "behind it": stated & ~itself & (position[other] <= position),
        "in another lane": _in_other_lane(table, stated & ~itself, other, info.frame_rate),
    }
    remedy = {
        "itself": "leave it empty where a vehicle has no leader; 0 or another number means none only if no "
        "vehicle has it as its id",
        "behind it": "name the vehicle ahead, or leave it empty: the column may be that of the followers",
    }
    for where, bad in causes.items():
        if bad.any():
            row = int(np.argmax(bad))
            text = f"the leader of vehicle {track[row]} is {where}"
            if where != "itself":
                text = f"vehicle {track[other[row]]}, the leader of vehicle {track[row]}, drives {where}"
            advice = remedy.get(where, "name the next vehicle ahead in the lane, or leave it empty")
            return Finding("wrong_leader", "leader_id", bad, text, advice)
    return None


def next_in_lane(table: pd.DataFrame) -> np.ndarray:
    """Row of the next vehicle ahead in the same lane at the same frame, ABSENT if there is none or without a lane."""
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    direction, frame = table["direction"].to_numpy(), table["frame"].to_numpy()
    order = np.lexsort((table["position"].to_numpy(), lane, direction, frame))
    same = np.isfinite(lane[order][1:])
    for values in (frame, direction, lane):
        same &= values[order][1:] == values[order][:-1]
    ahead = np.full(len(table), ABSENT)
    ahead[order[:-1][same]] = order[1:][same]
    return ahead


def states_all_leaders(in_lane: np.ndarray, stated: np.ndarray) -> bool:
    """True if the stated leaders count as complete, so that a vehicle without a stated leader has none.

    The arguments are the rows of the next vehicle ahead in the lane and of the stated leader, ABSENT for none.
    """
    is_stated = stated != ABSENT
    has_one = in_lane != ABSENT
    return bool(is_stated.any() and is_stated[has_one].sum() >= COMPLETE_SHARE * has_one.sum())


def leader_rows(table: pd.DataFrame) -> np.ndarray:
    """Row of the leader at the same frame for every row, ABSENT if there is none.

    It is the stated leader, else the next vehicle ahead in the lane; only stated ones if the source states all leaders.
    """
    in_lane, stated = next_in_lane(table), VehicleRows(table).leaders(table)
    return stated if states_all_leaders(in_lane, stated) else np.where(stated == ABSENT, in_lane, stated)


def notes_on_leaders(table: pd.DataFrame) -> list[str]:
    """Notes on the stated leaders: ids of absent vehicles, and leaders that are stated for some vehicles only."""
    named = table["leader_id"].dropna().to_numpy(np.int64)
    if not named.size:
        return []
    notes = []
    absent = np.unique(named[~np.isin(named, table["track_id"].to_numpy())])
    if absent.size:
        notes.append(f"{absent.size} stated leaders, such as {absent[0]}, are not vehicles of the recording")
    in_lane, stated = next_in_lane(table), VehicleRows(table).leaders(table)
    has_one, is_stated = in_lane != ABSENT, stated != ABSENT
    if is_stated.any() and not states_all_leaders(in_lane, stated):
        text = "of the rows with a vehicle ahead in the lane: the other leaders follow from the lanes"
        notes.append(f"leaders are stated for {is_stated[has_one].mean():.0%} {text}")
    position = table["position"].to_numpy()
    both = is_stated & has_one
    between = both & (position[np.where(both, in_lane, 0)] < position[np.where(both, stated, 0)])
    if between.any():
        text = "rows have another vehicle of their lane between them and their stated leader"
        notes.append(f"{int(between.sum())} of {int(both.sum())} {text}")
    return notes


def _in_other_lane(table: pd.DataFrame, stated: np.ndarray, other: np.ndarray, frame_rate: float) -> np.ndarray:
    """Mask of the rows of pairs that are never in the same lane and last longer than LANE_CHANGE.

    Where a lane is not known, lateral positions tell whether one vehicle drives beside the other. `stated` marks the
    rows with a leader, which is in the row `other` at the same frame.
    """
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    lateral = table["lateral"].to_numpy()
    have_lanes = np.isfinite(lane) & np.isfinite(lane[other])
    same = np.where(have_lanes, lane == lane[other], np.abs(lateral - lateral[other]) < BESIDE)
    known = np.flatnonzero(stated & (have_lanes | np.isfinite(lateral - lateral[other])))
    bad = np.zeros(len(table), dtype=bool)
    if not known.size:
        return bad
    track = table["track_id"].to_numpy()
    pairs = np.stack([track[known], track[other[known]]])
    _, pair, counts = np.unique(pairs, axis=1, return_inverse=True, return_counts=True)
    pair = pair.reshape(-1)
    n_same = np.bincount(pair, weights=same[known])
    apart = (n_same == 0) & (counts > LANE_CHANGE * frame_rate)
    bad[known[apart[pair]]] = True
    return bad

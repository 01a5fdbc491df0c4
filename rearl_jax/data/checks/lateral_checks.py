"""Checks of lanes and lateral positions: unit, direction, origin, and the direction of the road."""

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.typed_table import MAX_LANES
from rearl_jax.data.checks.unit_checks import (
    LANE_WIDTH,
    MIN_STEPS,
    WRONG_SHARE,
    is_other_unit,
    moving_steps,
    scale_of,
    unit_finding,
)
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_rows import first_and_last_rows

EDGE_TOLERANCE = 0.5
"""Largest distance [m] of a vehicle's centre to the left of the carriageway; beyond, half of the vehicle is off it."""

USUAL_WIDTH = 3.6
"""Width of a lane [m] if a single lane does not show it: 12 ft, and between the 3.5 and 3.75 m of motorways."""

MAX_DRIFT = 0.02
"""Largest median over vehicles of the lateral drift per distance driven [-]: 0.02 is an angle of 1.1 degrees.

Above it, positions are not measured along the road. One lane change in 200 m gives 0.018.
"""

MIN_DRIFT_VEHICLES = 5
"""Number of vehicles needed to check the drift; the drift of fewer may come from lane changes."""

MIN_DRIFT_DISTANCE = 50.0
"""Distance [m] that each of these vehicles must have driven."""


def stray_lane(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Finding of rows with a rare lane number that is not where their lateral position is, such as 9 for an unknown
    lane on a road of three.

    Only if lateral positions grow by the width of a lane without these lanes and do not with them: a ramp may be nearer
    than its number says.
    """
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    lateral, direction = table["lateral"].to_numpy(), table["direction"].to_numpy()
    bad = np.zeros(len(table), dtype=bool)
    for side in np.unique(direction):
        here = np.flatnonzero(
            (direction == side) & np.isfinite(lane) & np.isfinite(lateral) & (lane >= 0) & (lane < MAX_LANES)
        )
        lanes, middle = lane_middles(lane[here], lateral[here])
        usual, middle_of_usual = lane_middles(lane[here], lateral[here], max(int(WRONG_SHARE * here.size), 1))
        width = _width(usual, middle_of_usual)
        if width is not None and _width(lanes, middle) is None:
            off = np.abs(lateral[here] - middle_of_usual[0] - width * (lane[here] - usual[0]))
            bad[here] = ~np.isin(lane[here], usual) & (off > 0.75 * width)
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    text = f"lane {lane[row]:g}, counted from 0, is not where the vehicle is: lateral is {lateral[row]:.1f} m"
    remedy = "correct the lane, or leave it empty where it is unknown"
    return Finding("lane_out_of_range", "lane", bad, text, remedy)


def _width(lanes: np.ndarray, middle: np.ndarray) -> float | None:
    """Width of a lane [m] by the middles of the outer ones; None if it is not that of a lane, or unknown."""
    if not lanes.size:
        return None
    width = (middle[-1] - middle[0]) / (lanes[-1] - lanes[0]) if lanes.size > 1 else USUAL_WIDTH
    return float(width) if LANE_WIDTH[0] <= width <= LANE_WIDTH[1] else None


def is_below_first(lane: np.ndarray, lateral: np.ndarray) -> np.ndarray:
    """Mask of the rows of one carriageway in lanes below 0 that are left of lane 0, where their numbers say.

    A number that stands for an unknown lane, such as -1, is that of vehicles in all lanes.
    """
    lanes, middle = lane_middles(lane, lateral, MIN_STEPS)
    width = _width(lanes, middle)
    if lanes.size < 2 or width is None or not lanes[0] < 0 <= lanes[-1]:
        return np.zeros(len(lane), dtype=bool)
    off = middle - middle[0] - width * (lanes - lanes[0])
    return (lane < 0) & (np.abs(off) < 0.5 * width).all()


def wrong_lateral(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Finding of lateral positions that do not grow by the width of a lane from lane to lane."""
    lateral = table["lateral"].to_numpy()
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    lanes, middle = lane_middles(lane, lateral, MIN_STEPS)
    if lanes.size < 2:
        return None
    width = (middle[-1] - middle[0]) / (lanes[-1] - lanes[0])
    if LANE_WIDTH[0] <= width <= LANE_WIDTH[1]:
        return None
    text = f"lateral grows by {width:.2f} m per lane to the right, outside {LANE_WIDTH[0]} to {LANE_WIDTH[1]} m"
    remedy = "give lateral in m, positive to the right, and count lanes from the left"
    return unit_finding("lateral", np.isfinite(lateral) & (lane == lanes[-1]), text, remedy)


def lane_middles(lane: np.ndarray, lateral: np.ndarray, min_rows: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the lanes in ascending order, and the median lateral position of the rows in each.

    A lane counts if at least `min_rows` rows have both values, which are NaN where they are unknown.
    """
    known = np.isfinite(lateral) & np.isfinite(lane)
    lanes, counts = np.unique(lane[known], return_counts=True)
    lanes = lanes[counts >= min_rows]
    return lanes, np.array([np.median(lateral[known & (lane == number)]) for number in lanes])


def wrong_origin(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Finding of lanes that do not count from 0, or lateral positions that do not count from the left edge."""
    lateral = table["lateral"].to_numpy()
    outside = lateral < -EDGE_TOLERANCE
    # More rows may be outside if there are lane numbers, which determine the left edge by themselves.
    allowed = 0.5 if table["lane"].notna().to_numpy().any() else WRONG_SHARE
    if np.isfinite(lateral).sum() >= MIN_STEPS and outside.sum() > allowed * np.isfinite(lateral).sum():
        text = f"lateral is negative in {outside.sum()} rows, left of the carriageway"
        remedy = "count lateral from the left edge of the carriageway, positive to the right"
        return Finding("wrong_origin", "lateral", outside, text, remedy)
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    if (below := is_below_first(lane, lateral)).any():
        first = int(lane[below].min())
        text = f"vehicles of lane {first} drive left of those of lane 0"
        return Finding("wrong_origin", "lane", below, text, f"count lanes from 0 at the left: add {-first}")
    lanes = lanes_off(table)
    if lanes is None or lanes > -1:
        return None
    leftmost = int(np.nanmin(lane))
    if leftmost >= 1:
        text = f"no vehicle uses lane 0, and by lateral lane {leftmost} is the leftmost"
        remedy = f"count lanes from 0 at the left: subtract {min(-lanes, leftmost)}"
        return Finding("wrong_origin", "lane", np.isfinite(lane), text, remedy)
    text = f"vehicles are {-lanes} lanes further to the left than their lane says"
    return Finding("wrong_origin", "lateral", np.isfinite(lane), text, "count lateral from the left edge of lane 0")


def lanes_off(table: pd.DataFrame) -> int | None:
    """Number of lanes by which most vehicles are to the right of the lane that their rows state; None if unknown."""
    off = share_off(table)
    return None if off is None else int(np.sign(off)) * int(abs(off) + 0.25)


def share_off(table: pd.DataFrame) -> float | None:
    """Lane widths by which most vehicles are to the right of the middle of their lane; None if unknown."""
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    lanes, middle = lane_middles(lane, table["lateral"].to_numpy(), MIN_STEPS)
    width = _width(lanes, middle)
    return None if width is None else float(np.median(middle / width - lanes - 0.5))


def wrong_axis(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Finding of a drift of all vehicles to the same side: positions are not measured along the road."""
    starts, ends = first_and_last_rows(table["track_id"].to_numpy())
    position, lateral = table["position"].to_numpy(), table["lateral"].to_numpy()
    ahead, aside = position[ends] - position[starts], lateral[ends] - lateral[starts]
    judged = np.isfinite(aside) & (ahead > MIN_DRIFT_DISTANCE)
    if judged.sum() < MIN_DRIFT_VEHICLES:
        return None
    drift = float(np.median(aside[judged] / ahead[judged]))
    if abs(drift) <= MAX_DRIFT:
        return None
    text = f"vehicles move {abs(drift):.3f} m to the {'right' if drift > 0 else 'left'} per metre of position"
    text += f", so the road is {np.degrees(np.arctan(abs(drift))):.1f} degrees off the axis of the positions"
    remedy = "measure position along the road, and lateral across it"
    return unit_finding("position", np.isfinite(lateral), text, remedy)


def wrong_across(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Finding of y that does not grow with the lateral position, where x is along the road."""
    rows, step, _ = moving_steps(table, info)
    x, y, lateral = (table[name].to_numpy() for name in ("x", "y", "lateral"))
    if rows.size < MIN_STEPS or abs(np.median(np.abs(x[rows] - x[rows - 1]) / np.abs(step)) - 1.0) > 0.001:
        return None
    direction = table["direction"].to_numpy()
    for side in np.unique(direction):
        here = (direction == side) & np.isfinite(lateral)
        if here.sum() < MIN_STEPS or np.std(lateral[here]) < 0.5 * LANE_WIDTH[0]:
            continue
        scale = scale_of(np.abs(y[here] - np.mean(y[here])), np.abs(lateral[here] - np.mean(lateral[here])))
        if scale is not None and is_other_unit(scale):
            text = f"y grows {scale[0]:.2f} to {scale[1]:.2f} times as fast across the road as lateral"
            return unit_finding("y", here, text, "give y and lateral in m")
    return None

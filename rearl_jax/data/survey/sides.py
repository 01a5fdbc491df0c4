"""The side of the road from which lanes and lateral positions of an unknown table count."""

import numpy as np

from rearl_jax.data.checks.lateral_checks import lane_middles
from rearl_jax.data.checks.unit_checks import LANE_WIDTH
from rearl_jax.data.survey.proposal import Proposal
from rearl_jax.data.survey.sample import Sample
from rearl_jax.data.units import SI_FACTOR


def judge_sides(proposal: Proposal, sample: Sample) -> None:
    """Leaves out lanes and lateral positions that count in opposite directions, and states other uncertainties.

    If both count from the same side, the values do not show whether it is the left one; only canonical names, whose
    meaning is defined, do. The proposal is changed in place.
    """
    lane, lateral = proposal.taken.get("lane"), proposal.taken.get("lateral")
    values = {column.name: column.values for column in sample.columns}
    last = None if lane is None else f"{np.nanmax(values[lane.source]):.0f}"
    if lane is not None and lateral is not None:
        lanes, middle = lane_middles(values[lane.source], values[lateral.source] * SI_FACTOR[lateral.unit or "m"])
        width = (middle[-1] - middle[0]) / (lanes[-1] - lanes[0]) if lanes.size > 1 else 0.0
        if LANE_WIDTH[0] <= -width <= LANE_WIDTH[1]:
            why = f"{lateral.source} falls by {-width:.1f} m per lane, so one of the two counts from the right"
            proposal.leave_out("lane", why)
            proposal.leave_out("lateral", why)
            proposal.doubts.append(
                f"{why}: if it is the lane, add 'data.columns={{lane: {lane.source}, lateral: {lateral.source}}}' and "
                f"'data.units={{lane: -from {last}}}'; else 'data.units={{lateral: -{lateral.unit or 'm'}}}'"
            )
            return
    sides = []
    if lateral is not None and lateral.source != "lateral":
        sides.append((lateral.source, f"lateral: -{lateral.unit or 'm'}"))
    is_canonical = lane is not None and lane.source == "lane" and lane.unit is None
    if lane is not None and not is_canonical and np.unique(values[lane.source]).size > 1:
        sides.append((lane.source, f"lane: -from {last}"))
    if sides:
        names, units = (", ".join(part) for part in zip(*sides, strict=True))
        otherwise = f"if from the right, 'data.units={{{units}}}'"
        proposal.doubts.append(f"{names}: taken to count from the left of the drivers; {otherwise}")

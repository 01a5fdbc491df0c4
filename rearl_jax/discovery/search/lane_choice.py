"""Findings on lane choice, in addition to those on car following, and their entries in a verdict."""

from collections.abc import Sequence
from typing import Any

from rearl_jax.config import DiscoverConfig
from rearl_jax.data.records import Recording
from rearl_jax.discovery.lane_changes import KnownDrivers, LaneChangeFindings, lane_change_findings, too_few_changes
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.outcome import Search


def lane_choice(
    solver: Solver, search: Search, parts: Parts, recordings: Sequence[Recording], options: DiscoverConfig
) -> LaneChangeFindings:
    """Influences on lane choice, with the calibration and the parts of the car-following drivers.

    The recordings are those that the drivers were measured from by `read.reading.measure`, in the same order.
    """
    if (few := too_few_changes(recordings)) is not None:
        return few  # so that no driver is calibrated in vain
    states = [search.first.state, recalibrated(solver, search.checked, search.first)]
    known = KnownDrivers.of(states, solver.layout.prior)
    split = [part.vehicle for part in (parts.fitted, parts.checked, parts.reported)]
    return lane_change_findings(recordings, known, split, options.confidence, options.seed)


def with_lane_choice(verdict: dict[str, Any], lanes: LaneChangeFindings) -> dict[str, Any]:
    """The verdict on car following with findings on lane choice appended."""
    entries = lanes.as_verdict_parts()
    is_first = verdict["verdict"] == "nothing" and bool(lanes.effects)
    return verdict | {
        "verdict": "named" if is_first else verdict["verdict"],
        "effects": [*verdict["effects"], *entries["effects"]],
        "candidates": [*verdict["candidates"], *entries["candidates"]],
        "lane_choice": entries["lane_choice"],
        "data": verdict["data"] | {"notes": [*verdict["data"]["notes"], lanes.words]},
    }

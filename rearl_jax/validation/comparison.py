"""Differences of two runs of the same scenes, scene by scene and tick by tick. NumPy only.

A run is highway-env's or the core's. "Before contact" means the ticks before any vehicle of the scene has crashed in
the reference: collisions push vehicles apart along the axis of least overlap, and if two axes tie, or a vehicle rests
against another, a rounding error in the last place decides about a push of centimetres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.validation.records import Tracks

QUANTITIES = ("position", "speed", "heading")
"""Quantities compared: largest difference of x and y [m], of speed [m/s], of heading [rad]."""


@dataclass(frozen=True)
class Comparison:
    """Differences of a batch of scenes. Steps are the start, which is tick 0, and all ticks after it.

    Attributes:
        errors: For each of `QUANTITIES`, the largest difference over a scene's vehicles at every tick.
        position: Largest difference of x and y for every vehicle [m].
        contact: First tick with a crashed vehicle in the reference; the number of ticks where there is none.
        changed: Lane changes of the reference: the nearest lane differs from the tick before.
        changed_alike: Lane changes that the other run makes on the same tick into the same lane.
        changed_either: Lane changes that at least one run makes.
        flipped: Whether the target lanes of the two runs differ.
        crash_differs: Whether the crash flags of the two runs differ.
    """

    errors: dict[str, Float[np.ndarray, "steps scenarios"]]
    position: Float[np.ndarray, "steps vehicles scenarios"]
    contact: Int[np.ndarray, " scenarios"]
    changed: Bool[np.ndarray, "ticks vehicles scenarios"]
    changed_alike: Bool[np.ndarray, "ticks vehicles scenarios"]
    changed_either: Bool[np.ndarray, "ticks vehicles scenarios"]
    flipped: Bool[np.ndarray, "steps vehicles scenarios"]
    crash_differs: Bool[np.ndarray, "steps vehicles scenarios"]

    @property
    def before_contact(self) -> Bool[np.ndarray, "steps scenarios"]:
        """Mask of the ticks before the first contact of a scene."""
        return np.arange(len(self.position))[:, None] < self.contact


def compare(reference: Tracks, other: Tracks) -> Comparison:
    """Differences of two runs of the same scenes."""
    position = np.maximum(_difference(reference.x, other.x), _difference(reference.y, other.y))
    any_crashed = reference.crashed.any(1)
    n_steps = len(position)
    changed = reference.lane[1:] != reference.lane[:-1]
    other_changed = other.lane[1:] != other.lane[:-1]
    return Comparison(
        errors={
            "position": position.max(1),
            "speed": _difference(reference.speed, other.speed).max(1),
            "heading": _difference(reference.heading, other.heading).max(1),
        },
        position=position,
        contact=np.where(any_crashed.any(0), any_crashed.argmax(0), n_steps),
        changed=changed,
        changed_alike=changed & other_changed & (reference.lane[1:] == other.lane[1:]),
        changed_either=changed | other_changed,
        flipped=reference.target_lane != other.target_lane,
        crash_differs=reference.crashed != other.crashed,
    )


def first_disagreement(
    comparison: Comparison, *, tolerance: float, only_before_contact: bool
) -> tuple[Bool[np.ndarray, " scenarios"], Int[np.ndarray, " scenarios"]]:
    """Mask of the scenes that disagree in a position, target lane, lane change or crash flag, and the first such tick,
    0 where there is none.

    Args:
        comparison: Comparison of the two runs.
        tolerance: Largest difference of a position that is no disagreement [m].
        only_before_contact: Whether ticks from the first contact on are left out.
    """
    lane_differs = np.zeros(comparison.flipped.shape, bool)
    lane_differs[1:] = comparison.changed_either & ~comparison.changed_alike
    differs = (comparison.position > tolerance) | comparison.flipped | comparison.crash_differs | lane_differs
    differs_at = differs.any(1)
    if only_before_contact:
        differs_at &= comparison.before_contact
    return np.any(differs_at, axis=0), np.argmax(differs_at, axis=0)


def aborts(tracks: Tracks, is_meta: Bool[np.ndarray, "vehicles scenarios"]) -> Int[np.ndarray, " scenarios"]:
    """Lane changes aborted in each scene by IDM vehicles; `is_meta` marks vehicles that meta-actions control.

    While a change is in progress (the lane is not the target lane) nothing but the abort rule touches the target lane
    of an IDM vehicle. Source: highway-env 1.12.1, `IDMVehicle.change_lane_policy`.
    """
    was_changing = tracks.lane[:-1] != tracks.target_lane[:-1]
    is_new_target = tracks.target_lane[1:] != tracks.target_lane[:-1]
    return (was_changing & is_new_target & ~is_meta).sum((0, 1))


def rows(comparison: Comparison, reference: Tracks, is_meta: Bool[np.ndarray, "vehicles scenarios"]) -> list[dict]:
    """One row per scene: events in the reference, and the largest differences over all ticks and before contact."""
    before = comparison.before_contact
    columns = {
        "lane_changes": comparison.changed.sum((0, 1)),
        "aborts": aborts(reference, is_meta),
        "crashes": reference.crashed[-1].sum(0),
        "lane_changes_alike": comparison.changed_alike.sum((0, 1)),
        "lane_changes_either": comparison.changed_either.sum((0, 1)),
        "flips": comparison.flipped.any(0).sum(0),
        "flips_before_contact": (comparison.flipped & before[:, None]).any(0).sum(0),
        "crash_flags_equal": ~comparison.crash_differs.any((0, 1)),
    }
    for name in QUANTITIES:
        columns[f"max_{name}"] = comparison.errors[name].max(0)
        columns[f"max_{name}_before_contact"] = np.where(before, comparison.errors[name], 0.0).max(0)
    names = list(columns)
    return [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]


def _difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(a - b.astype(np.float64))

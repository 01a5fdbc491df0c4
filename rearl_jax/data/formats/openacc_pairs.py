"""Pairs of neighbours in a platoon of OpenACC: which are recorded, and whether their gap belongs to their speeds.

A gap grows by the integral of the difference of the two speeds. Each pair is checked by itself, because all pairs
together hide that one of them has the columns, the clock or the units of others.
"""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from rearl_jax.data.checks.unit_checks import is_other_unit, scale_of
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.records import RecordingInfo

_TIME = 2.0  # s over which a gap and its speeds are compared; the receivers' errors matter little over it
_MIN_CHANGE = 1.0  # m, root mean square of the change that the speeds imply; above it the receivers' errors are small
_MIN_VALUES = 20
# Correlations between a gap's changes and those that speeds imply. In 161 pairs of ZalaZone that of a pair's own speeds
# is above those of all other speeds, and above 0.7 if the change is above 0.6 m.
_OWN, _OF_OTHERS, _LEAST_LEAD = 0.5, 0.9, 0.3


def on_breaks(vehicles: Collection[int], gaps: Collection[int], names: Sequence[str] = ()) -> tuple[str, ...]:
    """Notes on the vehicles and gaps that a run lacks: nothing is known of their followers and leaders.

    `gaps` holds the numbers of the vehicles whose gap behind is recorded, `names` the models of all from number 1 on.
    """
    absent = [k for k in range(1, max([len(names), *vehicles]) + 1) if k not in vehicles]
    apart = [k for k in vehicles if k + 1 in vehicles and k not in gaps]
    notes = []
    if absent:
        named = ", ".join(f"{k} ({names[k - 1]})" if k <= len(names) else f"{k}" for k in absent)
        notes.append(f"vehicles that are not recorded: {named}; nobody is paired across them")
    if apart:
        pairs = ", ".join(f"{k} and {k + 1}" for k in apart)
        notes.append(f"vehicles with no gap between them: {pairs}; they are not paired")
    return tuple(notes)


def checked_pairs(
    gaps: np.ndarray, speed: np.ndarray, vehicles: Sequence[int], frame_rate: float, info: RecordingInfo
) -> tuple[str, ...]:
    """Notes on the pairs whose gap does not follow from their speeds.

    One row per frame: the gaps behind all vehicles except the last [m], NaN where unknown, and all speeds [m/s].

    Raises:
        BadRecordingError: A unit is wrong, or a gap follows the speeds of another pair.
    """
    n = round(_TIME * frame_rate)
    if len(speed) <= n:
        return ()
    closing = speed[:, :-1] - speed[:, 1:]
    mean = 0.5 * (closing[1:] + closing[:-1]) / frame_rate
    expected = np.stack([np.convolve(column, np.ones(n), mode="valid") for column in mean.T], axis=1)
    change = gaps[n:] - gaps[:-n]
    pairs = list(pairwise(vehicles))
    _require_units(change, expected, f"gaps of vehicles {vehicles[0]} to {vehicles[-1]}", info)
    alike = np.array([[_correlation(gap, other) for other in expected.T] for gap in change.T])
    own = np.diag(alike)
    notes = []
    for place, (ahead, behind) in enumerate(pairs):
        _require_units(change[:, place], expected[:, place], f"the gap between vehicles {ahead} and {behind}", info)
        best = int(np.argmax(alike[place]))
        # Exchanged gaps follow each other's speeds; one gap alone may do so by chance, or because its receiver failed.
        is_exchanged = np.argmax(alike[best]) == place != best and own[place] < alike[place, best] - _LEAST_LEAD
        if is_exchanged and own[best] < _OF_OTHERS < alike[place, best]:
            others = " and ".join(map(str, pairs[best]))
            text = f"the gap between vehicles {ahead} and {behind} follows the speeds of vehicles {others}"
            remedy = "number speeds and gaps alike: gap k is that between the vehicles k and k + 1"
            raise bad_recording("wrong-leader", text, remedy, info.file, column=info.columns["position"])
        implied = expected[np.isfinite(expected[:, place]), place]
        if implied.size and np.sqrt(np.mean(implied**2)) > _MIN_CHANGE and own[place] < _OWN:
            text = f"the gap between vehicles {ahead} and {behind} does not follow from their speeds"
            notes.append(f"{text} (correlation {own[place]:.2f}): columns or clocks may be those of others")
    return tuple(notes)


def _require_units(change: np.ndarray, expected: np.ndarray, what: str, info: RecordingInfo) -> None:
    """Raise BadRecordingError if the changes of gaps are a multiple of those that the speeds imply."""
    scale = scale_of(change.ravel(), expected.ravel())
    if scale is not None and is_other_unit(scale):
        text = f"{what}: changes are {scale[0]:.2f} to {scale[1]:.2f} times those that the speeds imply"
        remedy = "give speeds in m/s and gaps in m, of the vehicles that the columns name"
        raise bad_recording("wrong-units", text, remedy, info.file, column=info.columns["position"])


def _correlation(values: np.ndarray, others: np.ndarray) -> float:
    """Correlation of changes around 0; 1 if too few are known, or nothing changes."""
    known = np.isfinite(values) & np.isfinite(others)
    values, others = values[known], others[known]
    scale = float(np.sqrt(np.sum(values**2) * np.sum(others**2)))
    return float(np.sum(values * others)) / scale if values.size >= _MIN_VALUES and scale > 0.0 else 1.0

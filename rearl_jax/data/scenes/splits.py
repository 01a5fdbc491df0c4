"""Threshold, tuning and evaluation scenes: disjoint splits of the windows.

Scenes are grouped into units (one window, one recording, one block of time); units are shuffled and assigned as a
whole. Two scenes in different splits never contain the same second of the same recording, whatever the unit and the
overlap of windows, because scenes that would do so are left out and counted.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from rearl_jax.config.scenes import SplitConfig, SplitUnit
from rearl_jax.data.scenes.cutting import PAPER_SCENES
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

# Splits of the paper's 741 scenes. Source: Bi et al.; 150 is a rounded fifth.
_PAPER_SIZES = {"evaluation": 50, "threshold": 150, "tuning": 15}
_THRESHOLD_SHARE = 0.2
_MIN_SCENES = {"evaluation": 5, "threshold": 1, "tuning": 1}
_MIN_SCALED_SCENES = 5

TOO_FEW, TOO_SMALL = "scenes-too-few", "split-too-small"
"""Codes of the problems of too few scenes, and of too few units, for three splits."""

_SHORTEST = 5
"""Shortest scenes that are advised [s], the default of hist.window."""

# Border of a block in floating-point seconds; far below any frame interval.
_TIME_TOLERANCE = 1e-6


class Split(IntEnum):
    """Use of a scene."""

    REST = 0
    """In no other split; references of clustering may be fitted on it."""
    THRESHOLD = 1
    """Percentiles of Base, the simulation without REARL, over these become the detection thresholds."""
    TUNING = 2
    """Chooses among threshold pairs."""
    EVALUATION = 3
    """Results are reported on these."""
    DROPPED = 4
    """Crosses the border of two splits, or exceeds the size of its split; not used."""


@dataclass(frozen=True)
class Splits:
    """Assignment of every scene.

    Attributes:
        label: `Split` of every scene, in the order of the scenes.
        requested: Sizes asked for, by split name.
        n_crossing: Scenes dropped because they cross the border of two splits.
        n_surplus: Scenes dropped because the units of a split held more scenes than requested.
    """

    label: np.ndarray
    requested: dict[str, int]
    n_crossing: int
    n_surplus: int

    @property
    def threshold(self) -> np.ndarray:
        """Indices of the threshold scenes, in ascending order."""
        return self.indices(Split.THRESHOLD)

    @property
    def tuning(self) -> np.ndarray:
        """Indices of the tuning scenes, in ascending order."""
        return self.indices(Split.TUNING)

    @property
    def evaluation(self) -> np.ndarray:
        """Indices of the evaluation scenes, in ascending order."""
        return self.indices(Split.EVALUATION)

    def indices(self, split: Split) -> np.ndarray:
        """Indices of the scenes of one split, in ascending order."""
        return np.flatnonzero(self.label == split)

    def summary(self) -> dict[str, int]:
        """Number of scenes per split and of the dropped ones by cause."""
        sizes = {split.name.lower(): int(np.sum(self.label == split)) for split in Split if split != Split.DROPPED}
        return sizes | {"crossing": self.n_crossing, "surplus": self.n_surplus}


def split_scenes(scenes: SceneSet, split: SplitConfig) -> Splits:
    """Splits of a set of scenes; see `split_windows`."""
    return split_windows(scenes.recording, scenes.start_time, float(scenes.seconds), split)


def split_for_evaluation(scenes: SceneSet, split: SplitConfig) -> Splits:
    """Splits for a task that uses evaluation scenes only.

    The same as those of `split_scenes`, so that all methods are evaluated on the same scenes. If the scenes are too few
    for three splits, the requested number become evaluation scenes, and the other splits are empty.

    Raises:
        ValueError: Windows overlap and the unit is a scenario, or `split.evaluation` exceeds the number of scenes.
    """
    try:
        return split_scenes(scenes, split)
    except InvalidInputError as error:
        if error.code not in (TOO_FEW, TOO_SMALL):
            raise
    n_scenes, wanted = len(scenes), split.evaluation or _MIN_SCENES["evaluation"]
    if split.evaluation is not None and wanted > n_scenes:
        raise out_of_range("split.evaluation", f"must be at most {n_scenes}, the number of scenes", wanted)
    label = np.full(n_scenes, Split.REST, np.int8)
    label[np.random.default_rng(split.seed).permutation(n_scenes)[:wanted]] = Split.EVALUATION
    return Splits(label, {"evaluation": wanted, "threshold": 0, "tuning": 0}, 0, 0)


def split_windows(recording: np.ndarray, start_time: np.ndarray, seconds: float, split: SplitConfig) -> Splits:
    """Splits of windows of recordings.

    Units are shuffled with `split.seed`; evaluation takes units until it has its size, then threshold, then
    tuning, so the evaluation scenes do not depend on the other two sizes. Scenes of a unit beyond the size are dropped
    at random. A split stops early if it would leave less than one unit for each split after it. A window belongs to the
    seconds [start, start + seconds) since the start of its recording [s].

    Raises:
        ValueError: Windows overlap and the unit is a scenario; blocks are shorter than a window; too few
            windows or units for three splits.

    Source: sizes and order of Bi et al. (150 of 741 scenes for thresholds, then 15 and 50).
    """
    if split.unit is SplitUnit.scenario:
        _refuse_overlap(recording, start_time, seconds)
    if split.unit is SplitUnit.block and split.block_seconds < seconds - _TIME_TOLERANCE:
        message = f"must be at least the {seconds:g} s of a scene, better several times that, to lie inside a block"
        raise out_of_range("split.block_seconds", message, split.block_seconds)
    sizes = split_sizes(len(recording), split, seconds)
    first_unit, last_unit, n_units = _units(recording, start_time, seconds, split)
    rng = np.random.default_rng(split.seed)
    windows_in_unit = np.bincount(first_unit[first_unit == last_unit], minlength=n_units)
    unit_split = _assign_units(windows_in_unit, sizes, rng)

    # Border scenes: a window may reach over several blocks only if all of them are in one split.
    label = unit_split[first_unit].astype(np.int8)
    crossing = np.zeros(len(label), dtype=bool)
    for offset in range(1, int(np.max(last_unit - first_unit)) + 1):
        reached = np.minimum(first_unit + offset, last_unit)
        crossing |= unit_split[reached] != label
    label[crossing] = Split.DROPPED

    n_surplus = 0
    for name, size in sizes.items():
        members = np.flatnonzero(label == Split[name.upper()])
        surplus = rng.permutation(members)[size:]
        label[surplus] = Split.DROPPED
        n_surplus += len(surplus)
    splits = Splits(label, sizes, int(crossing.sum()), n_surplus)
    _refuse_small(splits, int(np.count_nonzero(windows_in_unit)), split)
    return splits


def split_sizes(n_scenes: int, split: SplitConfig, seconds: float = math.inf) -> dict[str, int]:
    """Number of scenes asked for per split, `evaluation`, `threshold`, `tuning`.

    The paper's 150, 15 and 50 of 741. For another number N: threshold 0.2 N; tuning and evaluation scaled by
    N / 741 (not above 15 and 50), at least 5. If these do not fit into N: evaluation as above, threshold 0.2 N, tuning
    the rest, the last two at least 1. A size given in the configuration is used unchanged. With the length of a scene
    [s] the error for too few scenes advises shorter ones.

    Raises:
        ValueError: Fewer scenes than the splits need.
    """
    scale = min(n_scenes / PAPER_SCENES, 1.0)
    sizes = {
        "evaluation": max(_MIN_SCALED_SCENES, _rounded(_PAPER_SIZES["evaluation"] * scale)),
        "threshold": max(1, _rounded(_THRESHOLD_SHARE * n_scenes)),
        "tuning": max(_MIN_SCALED_SCENES, _rounded(_PAPER_SIZES["tuning"] * scale)),
    }
    if n_scenes == PAPER_SCENES:
        sizes["threshold"] = _PAPER_SIZES["threshold"]
    given = {name: getattr(split, name) for name in sizes if getattr(split, name) is not None}
    sizes |= given
    for name in ("tuning", "threshold"):
        if name not in given:
            spare = n_scenes - (sum(sizes.values()) - sizes[name])
            sizes[name] = max(1, min(sizes[name], spare))
    if sum(sizes.values()) > n_scenes:
        least = sum(given.get(name, size) for name, size in _MIN_SCENES.items())
        message = (
            f"{n_scenes} scenes are too few for the splits evaluation, threshold and tuning: {least} are needed with "
            f"the sizes given ({given or 'none given'})"
        )
        raise InvalidInputError(Problem(TOO_FEW, message, _remedy(n_scenes, least, seconds)))
    return sizes


def _remedy(n_scenes: int, least: int, seconds: float) -> str:
    """Remedy for too few scenes: more recordings, shorter scenes or smaller splits."""
    remedies = ["read more recordings"]
    shorter = 0 if math.isinf(seconds) else int(seconds // math.ceil(least / n_scenes))
    if shorter >= _SHORTEST:
        remedies.append(f"set scenes.seconds={shorter}")
    if n_scenes >= len(_MIN_SCENES):
        small = f"split.evaluation={n_scenes - 2} split.threshold=1 split.tuning=1"
        remedies.append(f"set {small}")
    return ", or ".join(remedies)


def _rounded(value: float) -> int:
    """Nearest integer, halves up."""
    return int(np.floor(value + 0.5))


def _refuse_overlap(recording: np.ndarray, start_time: np.ndarray, seconds: float) -> None:
    """Raise InvalidInputError if windows of a recording overlap."""
    order = np.lexsort((start_time, recording))
    step = np.diff(start_time[order])
    same = recording[order][1:] == recording[order][:-1]
    # Equal starts are the two carriageways of one window; they stay together as one unit.
    overlap = same & (step > _TIME_TOLERANCE) & (step < seconds - _TIME_TOLERANCE)
    if overlap.any():
        first = int(np.flatnonzero(overlap)[0])
        message = (
            f"is scenario, which needs windows that do not overlap, but recording {recording[order][first]} has "
            f"windows of {seconds:g} s that start at {start_time[order][first]:g} s and "
            f"{start_time[order][first + 1]:g} s: "
            "two splits would share seconds of traffic"
        )
        remedy = "set split.unit=block (or recording), or leave scenes.stride at null"
        raise InvalidInputError(Problem("windows-overlap", message, remedy, key="split.unit"))


def _units(
    recording: np.ndarray, start_time: np.ndarray, seconds: float, split: SplitConfig
) -> tuple[np.ndarray, np.ndarray, int]:
    """First and last unit every window touches, and the number of units.

    Units of one recording have consecutive numbers in the order of time; block numbers without any window
    stay between them, so a window that reaches over blocks touches all numbers from its first to its last.
    """
    _, recording_index = np.unique(recording, return_inverse=True)
    if split.unit is SplitUnit.recording:
        return recording_index, recording_index, int(recording_index.max()) + 1
    if split.unit is SplitUnit.scenario:
        windows = np.stack([recording_index, np.round(start_time / _TIME_TOLERANCE)], axis=1)
        _, unit = np.unique(windows, axis=0, return_inverse=True)
        return unit, unit, int(unit.max()) + 1
    first = np.floor((start_time + _TIME_TOLERANCE) / split.block_seconds).astype(np.int64)
    last = np.ceil((start_time + seconds - _TIME_TOLERANCE) / split.block_seconds).astype(np.int64) - 1
    blocks_per_recording = np.zeros(int(recording_index.max()) + 1, dtype=np.int64)
    np.maximum.at(blocks_per_recording, recording_index, last + 1)
    offset = np.concatenate([[0], np.cumsum(blocks_per_recording)])
    return offset[recording_index] + first, offset[recording_index] + last, int(offset[-1])


def _assign_units(windows_in_unit: np.ndarray, sizes: dict[str, int], rng: np.random.Generator) -> np.ndarray:
    """Split of every unit."""
    unit_split = np.full(len(windows_in_unit), Split.REST, dtype=np.int8)
    # Only units with a window can fill a split; the others stay in the rest.
    waiting = list(rng.permutation(np.flatnonzero(windows_in_unit)))
    for position, (name, size) in enumerate(sizes.items()):
        n_later = len(sizes) - position - 1
        n_taken = 0
        while n_taken < size and len(waiting) > n_later:
            unit = waiting.pop(0)
            unit_split[unit] = Split[name.upper()]
            n_taken += int(windows_in_unit[unit])
    return unit_split


def _refuse_small(splits: Splits, n_units: int, split: SplitConfig) -> None:
    """Raise InvalidInputError if a split got fewer scenes than it needs."""
    sizes = splits.summary()
    for name, least in _MIN_SCENES.items():
        needed = min(least, splits.requested[name])
        if sizes[name] < needed:
            remedy = {
                SplitUnit.scenario: "read more recordings",
                SplitUnit.recording: "set split.unit=scenario without overlap (scenes.stride=null), or read more "
                "recordings",
                SplitUnit.block: "set split.unit=scenario without overlap (scenes.stride=null), or split.block_seconds "
                "lower",
            }[split.unit]
            other_seed = ", or set another split.seed" if n_units >= len(_MIN_SCENES) else ""
            message = (
                f"the {name} split got {sizes[name]} of {splits.requested[name]} scenes, at least {needed} are needed: "
                f"split.unit={split.unit.name} makes only {n_units} units of {len(splits.label)} scenes "
                f"({splits.n_crossing} of them cross the border of two splits)"
            )
            raise InvalidInputError(Problem(TOO_SMALL, message, f"{remedy}{other_seed}"))

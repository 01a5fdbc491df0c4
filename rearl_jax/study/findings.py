"""Conclusions from the figures of Table 1, in sentences computed from these figures alone.

Real against real are recorded scenes scored against other recorded scenes, controls the rows that show what a method's
choices are worth. "Closer" and "farther" are used only if an interval excludes zero. Time headway and lane-change rate
are never called better, because they describe the traffic.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rearl_jax.evaluation.estimates import FEW_SCENES


@dataclass(frozen=True)
class Difference:
    """Difference of two figures with its interval; without bounds if fewer than two scenes have both."""

    value: float
    low: float | None = None
    high: float | None = None

    @property
    def sign(self) -> int:
        """-1 or 1 if the interval excludes zero, else 0."""
        if self.low is None or self.high is None:
            return 0
        return -1 if self.high < 0 else int(self.low > 0)

    def __str__(self) -> str:
        if self.value == self.low == self.high == 0:
            return "identical"
        ends = "" if self.low is None or self.high is None else f", {self.low:+.3f} to {self.high:+.3f}"
        return f"{self.value:+.3f}{ends}"


@dataclass(frozen=True)
class RowDifferences:
    """Differences of one row's error from that of others.

    Attributes:
        title: Title of the row.
        less_base: Error minus that of base from the same initial states; None for base itself.
        less_real: Error minus that of real against real.
        less_controls: Error minus that of each control, by its title; empty for rows without controls.
    """

    title: str
    less_base: Difference | None = None
    less_real: Difference | None = None
    less_controls: Mapping[str, Difference] = field(default_factory=dict)


def findings(
    errors: Mapping[str, Sequence[RowDifferences]], *, n_scenes: int, confidence: float, generated: bool
) -> list[str]:
    """The sentences, error by error.

    Args:
        errors: Differences of every row, by the title of the error (smaller is closer).
        n_scenes: Held-out scenes behind the intervals.
        confidence: Confidence of the intervals [-].
        generated: Whether the recordings were generated, not measured.
    """
    sentences = ["GENERATED recordings: the following says nothing about real traffic."] if generated else []
    for title, rows in errors.items():
        sentences += _against_base(title, rows)
        sentences += _against_real(title, rows)
        sentences += _against_controls(title, rows)
    return sentences + _reliability(errors, n_scenes, confidence)


def _against_base(title: str, rows: Sequence[RowDifferences]) -> list[str]:
    compared = {row.title: row.less_base for row in rows if row.less_base is not None}
    if not compared:
        return []
    closer, same, farther = _sorted(compared)
    parts = [
        f"closer than base: {closer or 'no row'}",
        f"farther: {farther}" if farther else "",
        f"not distinguished from base: {same}" if same else "",
    ]
    return [f"{title}: {'; '.join(part for part in parts if part)}."]


def _against_real(title: str, rows: Sequence[RowDifferences]) -> list[str]:
    compared = {row.title: row.less_real for row in rows if row.less_real is not None}
    if not compared:
        return []
    closer, same, _ = _sorted(compared)
    if closer:
        return [
            f"{title}: closer than real scenes are to each other: {closer}. This is not realism: only a method "
            "that copies its references can be this close, not an independent simulation."
        ]
    if same:
        return [f"{title}: not distinguished from real against real: {same}; no row is closer."]
    return [f"{title}: every row is farther than real scenes are from each other."]


def _against_controls(title: str, rows: Sequence[RowDifferences]) -> list[str]:
    sentences = []
    for row in rows:
        if not row.less_controls:
            continue
        closer, same, farther = _sorted(row.less_controls)
        parts = [
            f"closer than its controls {closer}" if closer else "",
            f"not distinguished from its controls {same}" if same else "",
            f"farther than its controls {farther}" if farther else "",
        ]
        comparison = "; ".join(part for part in parts if part)
        if same or farther:
            end = (
                " Not every control does worse, so a gain by its choices is not shown."
                if closer
                else " Controls do as well, so its choices do not explain the gain."
            )
        else:
            end = " All its controls do worse."
        sentences.append(f"{title}: {row.title} is {comparison}.{end}")
    return sentences


def _sorted(compared: Mapping[str, Difference]) -> tuple[str, str, str]:
    """Names with their differences, in three lists: below zero, not significantly different from zero, above zero."""
    by_sign: dict[int, list[str]] = {-1: [], 0: [], 1: []}
    for name, difference in compared.items():
        by_sign[difference.sign].append(f"{name} ({difference})")
    below, zero, above = (", ".join(by_sign[sign]) for sign in (-1, 0, 1))
    return below, zero, above


def _reliability(errors: Mapping[str, Sequence[RowDifferences]], n_scenes: int, confidence: float) -> list[str]:
    """Number of intervals computed, and a warning if there are few scenes."""
    differences = [
        difference
        for rows in errors.values()
        for row in rows
        for difference in (row.less_base, row.less_real, *row.less_controls.values())
        if difference is not None and difference.low is not None
    ]
    if not differences:
        return [f"{n_scenes} held-out scene(s) give no intervals, so nothing can be distinguished."]
    by_chance = (1 - confidence) * len(differences)
    sentences = [
        f"{len(differences)} intervals of {100 * confidence:g} % were computed; about {by_chance:.1f} of them would "
        "exclude zero by chance alone."
    ]
    if n_scenes < FEW_SCENES:
        sentences.append(
            f"With only {n_scenes} held-out scenes a bootstrap over scenes is rough, and its intervals are too narrow."
        )
    return sentences

"""Details of a blind study: outcomes by set, errors, stated confidence, parameters, strengths."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from rearl_jax.blind.cases import BROAD, BROAD_CONTROL, REPEATS, SUMO_MODELS
from rearl_jax.blind.judging import OUTCOMES, Recovery
from rearl_jax.blind.questions import Judged
from rearl_jax.blind.scores import rate_of
from rearl_jax.config.blind import StudySize

ALL_LISTED = "all with effects of the list"
"""Name of the first row of `by_set`: data sets of the generator in which only effects of the library are hidden."""

NO_CAUSE, MEASURED_CAUSE = "unlisted, no variable", "unlisted, over a variable"
"""Names of the rows of effects outside the library, without and with a measured variable that causes them."""

SET_TITLES = {
    ALL_LISTED: "all with effects of the library",
    NO_CAUSE: "unlisted, no measured cause",
    MEASURED_CAUSE: "unlisted, measured cause",
}
"""Titles of sets in documents; the other sets are shown by their names."""

CONFIDENCES = (0.0, 0.5, 0.8, 0.9, 0.95, 1.0)
"""Edges of the ranges of stated confidence [-]."""


def by_set(cases: Iterable[Judged]) -> list[dict]:
    """Rows by set, and by model of SUMO: number of data sets, in all and by outcome.

    `n_false` counts data sets with at least one wrongly reported effect, whatever their outcome; `rate` is its share of
    the data sets, with the bounds `low` and `high` of its interval.
    """
    by_name: dict[str, list[Judged]] = {}
    for case in sorted(cases, key=_sort_key):
        for name in (*((ALL_LISTED,) if case.is_listed else ()), set_name(case)):
            by_name.setdefault(name, []).append(case)
    rows = []
    for name in sorted(by_name, key=lambda name: name != ALL_LISTED):
        n, counts = len(by_name[name]), outcome_counts(by_name[name])
        rows.append({"set": name, "n": n, **counts, **rate_of(counts["n_false"], n)})
    return rows


def outcome_counts(cases: Sequence[Judged]) -> dict[str, int]:
    """Number of data sets by outcome, and of those with at least one wrongly reported effect, `n_false`."""
    outcomes = [case.judgement.outcome for case in cases]
    counts = {f"n_{outcome}": outcomes.count(outcome) for outcome in OUTCOMES}
    return counts | {"n_false": sum(bool(case.judgement.false_names) for case in cases)}


def set_name(case: Judged) -> str:
    """Name of the group a data set belongs to; for SUMO its model, for effects outside the library NO_CAUSE or
    MEASURED_CAUSE.
    """
    if case.is_sumo:
        return f"SUMO {case.truth['variant']}"
    if case.group != "unlisted":
        return case.group
    return MEASURED_CAUSE if case.truth["planted"][0]["variables"] else NO_CAUSE


def _sort_key(case: Judged) -> tuple[int, int, str]:
    groups = [*REPEATS[StudySize.full], BROAD, BROAD_CONTROL]
    model = SUMO_MODELS.index(case.truth["variant"]) if case.is_sumo else 0
    return groups.index(case.group), model, set_name(case)


def oracle_share(cases: Iterable[Judged]) -> tuple[float | None, int]:
    """Achieved share of the largest possible error reduction, and number of data sets.

    The largest possible reduction is that of the oracle, which knows the hidden effect. The share is the sum of
    before^2 - after^2 divided by that of before^2 - oracle^2, over the data sets for which all three errors are known;
    None if there are none.
    """
    achieved, possible, n = 0.0, 0.0, 0
    for case in cases:
        before, after, oracle = (case.verdict.errors[name] for name in ("before", "after", "oracle"))
        if before is not None and after is not None and oracle is not None:
            achieved += before.value**2 - after.value**2
            possible += before.value**2 - oracle.value**2
            n += 1
    return (achieved / possible if possible > 0.0 else None), n


def confidence_calibration(cases: Iterable[Judged]) -> list[dict]:
    """Rows by range of stated confidence: number of claimed effects, their mean stated confidence, and the share of
    them that is correct (`true`), with its interval.
    """
    claims = [claim for case in cases for claim in case.judgement.claims]
    rows = []
    for low, high in pairwise(CONFIDENCES):
        in_range = [
            (stated, is_correct) for stated, is_correct in claims if low < stated <= high or stated == low == 0.0
        ]
        if in_range:
            row = {
                "from": low,
                "to": high,
                "n_claims": len(in_range),
                "stated": float(np.mean([s for s, _ in in_range])),
            }
            rows.append(
                row | rate_of(sum(is_correct for _, is_correct in in_range), len(in_range), ("true", "low", "high"))
            )
    return rows


def parameter_rows(cases: Iterable[Judged]) -> list[dict]:
    """Rows by effect and parameter: mean absolute true value (`truth`), mean error (`bias`), bias divided by `truth`,
    root mean square error, and share of the intervals that contain the true value (`coverage`).
    """
    by_parameter: dict[tuple[str, str], list[Recovery]] = {}
    for case in cases:
        for item in case.recoveries:
            by_parameter.setdefault((item.effect, item.parameter), []).append(item)
    rows = []
    for (effect, parameter), items in sorted(by_parameter.items()):
        errors = np.array([item.found.value - item.truth for item in items])
        size = float(np.mean([abs(item.truth) for item in items]))
        covered = [item.is_covered for item in items if item.is_covered is not None]
        row = {
            "effect": effect, "parameter": parameter, "n": len(items), "truth": size,
            "bias": float(errors.mean()), "relative_bias": float(errors.mean()) / size if size else None,
            "rms_error": float(np.sqrt(np.mean(errors**2))), "n_intervals": len(covered),
        }  # fmt: skip
        rows.append(row | rate_of(sum(covered), len(covered), ("coverage", "coverage_low", "coverage_high")))
    return rows


def by_strength(cases: Iterable[Judged]) -> list[dict]:
    """Rows by effect and strength, over the data sets that hide one effect of the library at the default amount of data
    (the set `named` at the usual strength, and `half`, `quarter`, `double`).

    `n_named` counts data sets in which the effect was named, whatever else was; `rate` is its share, with the bounds
    `low` and `high` of its interval. `n_false` counts those with at least one wrongly reported effect.
    """
    by_key: dict[tuple[str, float], list[Judged]] = {}
    for case in cases:
        if case.group in ("named", "half", "quarter", "double") and not case.is_sumo:
            for name in (case.truth["variant"], "all"):
                by_key.setdefault((name, case.truth["planted"][0]["strength"]), []).append(case)
    rows = []
    for (name, strength), items in sorted(by_key.items()):
        n, n_named, n_false = len(items), sum(case.is_named for case in items), outcome_counts(items)["n_false"]
        row = {"effect": name, "strength": strength, "n": n, "n_named": n_named, "n_false": n_false}
        rows.append(row | rate_of(n_named, n))
    return rows

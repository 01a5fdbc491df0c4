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

CONFIDENCES = (0.0, 0.5, 0.8, 0.9, 0.95, 1.0)
"""Edges of the ranges of stated confidence [-]."""


def by_set(cases: Iterable[Judged]) -> list[dict]:
    """Rows by set, and by model of SUMO: data sets, outcomes, and the number of data sets with a false name.

    A false name counts for every outcome, because it may accompany a correct name or the verdict `unexplained`.
    """
    by_name: dict[str, list[Judged]] = {}
    for case in sorted(cases, key=_place_of_set):
        for name in (*((ALL_LISTED,) if case.is_listed else ()), set_name(case)):
            by_name.setdefault(name, []).append(case)
    rows = []
    for name in sorted(by_name, key=lambda name: name != ALL_LISTED):
        n, counts = len(by_name[name]), outcome_counts(by_name[name])
        rows.append({"set": name, "n": n, **counts, **rate_of(counts["n_false"], n)})
    return rows


def outcome_counts(cases: Sequence[Judged]) -> dict[str, int]:
    """Number of data sets by outcome, and with a false name."""
    outcomes = [case.judgement.outcome for case in cases]
    counts = {f"n_{outcome}": outcomes.count(outcome) for outcome in OUTCOMES}
    return counts | {"n_false": sum(bool(case.judgement.false_names) for case in cases)}


def set_name(case: Judged) -> str:
    """The set of a data set; for SUMO with the model, for unlisted effects with whether a measured variable explains
    them.
    """
    if case.is_sumo:
        return f"SUMO {case.truth['variant']}"
    if case.group != "unlisted":
        return case.group
    return f"unlisted, {'over a variable' if case.truth['planted'][0]['variables'] else 'no variable'}"


def _place_of_set(case: Judged) -> tuple[int, int, str]:
    groups = [*REPEATS[StudySize.full], BROAD, BROAD_CONTROL]
    model = SUMO_MODELS.index(case.truth["variant"]) if case.is_sumo else 0
    return groups.index(case.group), model, set_name(case)


def oracle_share(cases: Iterable[Judged]) -> tuple[float | None, int]:
    """Share of the oracle's reduction of the squared error that is reached, and the number of data sets.

    Sums over data sets with a known oracle, of before^2 - after^2 over before^2 - oracle^2.
    """
    reached, possible, n = 0.0, 0.0, 0
    for case in cases:
        before, after, oracle = (case.verdict.errors[name] for name in ("before", "after", "oracle"))
        if before is not None and after is not None and oracle is not None:
            reached += before.value**2 - after.value**2
            possible += before.value**2 - oracle.value**2
            n += 1
    return (reached / possible if possible > 0.0 else None), n


def calibration(cases: Iterable[Judged]) -> list[dict]:
    """Rows by stated confidence: claims, mean confidence, share of correct claims with its interval."""
    claims = [claim for case in cases for claim in case.judgement.claims]
    rows = []
    for low, high in pairwise(CONFIDENCES):
        inside = [(stated, there) for stated, there in claims if low < stated <= high or stated == low == 0.0]
        if inside:
            row = {"from": low, "to": high, "n_claims": len(inside), "stated": float(np.mean([s for s, _ in inside]))}
            rows.append(row | rate_of(sum(there for _, there in inside), len(inside), ("true", "low", "high")))
    return rows


def parameter_rows(cases: Iterable[Judged]) -> list[dict]:
    """Rows by effect and parameter: mean truth, mean error, relative bias, coverage of the intervals."""
    known: dict[tuple[str, str], list[Recovery]] = {}
    for case in cases:
        for item in case.recoveries:
            known.setdefault((item.effect, item.parameter), []).append(item)
    rows = []
    for (effect, parameter), items in sorted(known.items()):
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
    """Rows by strength: number of named data sets, among those with one library effect and the default amount of data.

    `n_false` is the number with a false name.
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

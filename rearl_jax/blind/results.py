"""The results of a blind study as tables, and the figures of its summary."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.blind.cases import BROAD, BROAD_CONTROL
from rearl_jax.blind.details import by_set, by_strength, oracle_share, outcome_counts
from rearl_jax.blind.questions import Judged
from rearl_jax.blind.scores import Score, score_all
from rearl_jax.blind.strata import by_stratum, redraws
from rearl_jax.blind.verdicts import NOTHING, UNEXPLAINED

SHOWN_GROUPS = ("named", "artefact", "unlisted", "control", "sumo", BROAD, BROAD_CONTROL)
"""Sets of the confusion matrix: one effect at its usual strength, or none."""

BROAD_COLUMNS = ("base", "is_smoothed", "has_many_changes", "lane_changes_per_minute", "mean_speed", "effect_size")
"""Columns of data sets with broad priors."""


@dataclass(frozen=True)
class BlindResults:
    """All results of a study.

    Attributes:
        cases: The data sets that were run.
        n_drawn: Number of data sets in the study; `cases` are the first of them in random order.
    """

    cases: Sequence[Judged]
    n_drawn: int

    @cached_property
    def scores(self) -> list[Score]:
        """Rates."""
        return score_all(self.cases)

    @cached_property
    def sets(self) -> list[dict]:
        """See `by_set`."""
        return by_set(self.cases)

    @cached_property
    def strengths(self) -> list[dict]:
        """See `by_strength`."""
        return by_strength(self.cases)

    @cached_property
    def strata(self) -> list[dict]:
        """See `by_stratum`."""
        return by_stratum(self.cases)

    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables derived from the table of data sets, by file name; `strata` with broad priors only."""
        tables = {
            "scores": pd.DataFrame([vars(score) | {"rate": score.rate} for score in self.scores]),
            "sets": pd.DataFrame(self.sets),
            "confusion": self.confusion(),
            "strengths": pd.DataFrame(self.strengths),
        }
        return tables | ({"strata": pd.DataFrame(self.strata)} if self.strata else {})

    def confusion(self) -> pd.DataFrame:
        """Number of data sets by hidden effect (rows, `hidden`) and verdict (columns)."""
        shown_cases = [case for case in self.cases if case.group in SHOWN_GROUPS]
        hidden = dict.fromkeys(row_name(case) for case in sorted(shown_cases, key=_sort_key))
        reported = [(row_name(case), column_name(case)) for case in shown_cases]
        used_columns = {column for _, column in reported}
        columns = [name for name in dict.fromkeys([*hidden, *sorted(used_columns)]) if name in used_columns]
        columns.sort(key=lambda name: _LAST.index(name) if name in _LAST else -1)
        counts = pd.DataFrame(0, index=list(hidden), columns=columns)
        for row, column in reported:
            counts.loc[row, column] += 1
        return counts.rename_axis("hidden").reset_index()

    def case_table(self) -> pd.DataFrame:
        """One row per data set; `named` (all names) and `false` (false names) contain names joined by +."""
        return pd.DataFrame([_row(case) for case in self.cases])

    def summary(self) -> dict[str, Any]:
        """Key-value pairs, and the rates as a list."""
        share, n = oracle_share(self.cases)
        seconds = [case.verdict.seconds for case in self.cases if case.verdict.seconds is not None]
        return {
            "n_cases": len(self.cases),
            "n_drawn": self.n_drawn,
            **outcome_counts(self.cases),
            "oracle_share": share,
            "n_oracles": n,
            "median_seconds": float(np.median(seconds)) if seconds else None,
            "scores": [
                {"name": score.name, "hits": score.n_hits, "cases": score.n_cases, "rate": score.rate,
                 "low": score.low, "high": score.high, "goal": score.goal, "is_met": score.is_met}
                for score in self.scores
            ],
            "sets": self.sets,
            **({"strata": self.strata, "redraws": redraws(self.cases)} if self.strata else {}),
        }  # fmt: skip


_LAST = (UNEXPLAINED, NOTHING, "failed")
"""Last columns of the confusion matrix."""


def row_name(case: Judged) -> str:
    """Row of a data set in the confusion matrix: its hidden effect."""
    if case.group in ("control", BROAD_CONTROL):
        return "nothing hidden"
    return f"SUMO {case.truth['variant']}" if case.is_sumo else case.truth["variant"]


def column_name(case: Judged) -> str:
    """Column of a data set in the confusion matrix; an effect recognised by another correct name keeps its own."""
    if case.judgement.n_recognised:
        return case.truth["planted"][0]["truths"][0] if case.is_sumo else row_name(case)
    return case.judgement.shown


def _sort_key(case: Judged) -> tuple[int, str]:
    return SHOWN_GROUPS.index(case.group), row_name(case)


def _row(case: Judged) -> dict[str, Any]:
    verdict, judgement = case.verdict, case.judgement
    planted = case.truth["planted"]
    row: dict[str, Any] = {
        "case": case.name,
        "set": case.group,
        "variant": case.truth["variant"],
        "source": case.truth["source"],
        "hidden": "+".join(item["name"] for item in planted),
        "strength": planted[0]["strength"] if planted else None,
        "verdict": verdict.verdict,
        "named": "+".join(effect.name for effect in verdict.effects),
        "alternatives": "+".join(sorted(verdict.alternatives)),
        "outcome": judgement.outcome,
        "n_hidden": judgement.n_hidden,
        "n_recognised": judgement.n_recognised,
        "in_set": judgement.in_set,
        "is_flagged": judgement.is_flagged,
        "false": "+".join(judgement.false_names),
        "n_intervals": case.n_intervals,
        "n_covered": case.n_covered,
        "n_drivers": verdict.n_drivers,
        "seconds": verdict.seconds,
        "message": verdict.message,
    }
    if "base" in case.truth:
        row |= {name: case.truth[name] for name in BROAD_COLUMNS}
    for name, interval in verdict.errors.items():
        row[name] = None if interval is None else interval.value
        row |= {f"{name}_{end}": None if interval is None else getattr(interval, end) for end in ("low", "high")}
    return row | {"confidence": next((stated for stated, _ in judgement.claims), None)}

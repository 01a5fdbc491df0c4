"""Rows of `table1.traffic` as figures, as rows of the long table of Table 1, and as tables of its document."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config.decision import PolicyName
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.document.document import Section
from rearl_jax.evaluation.estimates import means_with_intervals
from rearl_jax.evaluation.scores import REAL_VS_REAL, TITLES
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.metrics import METRICS
from rearl_jax.study.budget.figures import scene_figures
from rearl_jax.study.document import beside_paper, less_base_table, long_table

PREFIX = "recorded_"
"""Prefix of the names of the rows of `table1.traffic`, whose scenes start as recorded."""

COMPARED_FIGURES = ("h", "mape_a", "mape_b", "mape_c", "position_error")
"""Figures that are compared with those of the same traffic without REARL."""

HEADINGS_ON_TRAFFIC = {
    **{name: HEADINGS[name] for name in ("h", "mape_a", "mape_b", "mape_c", "collisions")},
    "position_error": "position error [m]",
    "interventions": "interventions per vehicle and minute",
    "changes": "of them changing speed or lane",
}
"""Figures of the table, and their headings."""

_DIGITS = {"position_error": 1, "interventions": 1, "changes": 1}
_UNITS = {"position_error": "m", "interventions": "1/min", "changes": "1/min"}

TITLES_OF_KINDS = {
    "base": "Base",
    "boundary": "replayed neighbours",
    "calibrated": "calibrated drivers",
    "both": "calibrated drivers, replayed neighbours",
}
"""Titles of the kinds of traffic, in the order of the table."""

TITLES_OF_POLICIES = {
    None: "without REARL",
    PolicyName.idle: "idle",
    PolicyName.matcher: "matcher",
    PolicyName.llm: "language model",
}
"""Titles of the policies; None is traffic without REARL."""


def titles_of_kinds(*, has_found: bool) -> dict[str, str]:
    """Titles of the kinds of traffic; `has_found` says whether the drivers have effects that discovery found."""
    drivers = "repaired" if has_found else "calibrated"
    return {kind: title.replace("calibrated", drivers) for kind, title in TITLES_OF_KINDS.items()}


Figures = Mapping[tuple[str, str], Mapping[str, float | None]]
"""By row and figure: the value under "", `_low`, `_high`, and for compared figures `_less_base` with both ends."""


def name_of(kind: str, policy: PolicyName | None) -> str:
    """Name of a row: `recorded_KIND`, with REARL `recorded_KIND_POLICY`."""
    return f"{PREFIX}{kind}" if policy is None else f"{PREFIX}{kind}_{policy.name}"


def named_rows(names: set[str]) -> list[tuple[str, str, PolicyName | None]]:
    """Name, kind and policy of the rows with the given names, in the order of the table."""
    all_rows = ((name_of(kind, policy), kind, policy) for kind in TITLES_OF_KINDS for policy in TITLES_OF_POLICIES)
    return [row for row in all_rows if row[0] in names]


def split_rows(table: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The long table without the rows of `table1.traffic`, and these rows."""
    is_on_traffic = table["row"].str.startswith(PREFIX).to_numpy(bool)
    return table.iloc[np.flatnonzero(~is_on_traffic)], table.iloc[np.flatnonzero(is_on_traffic)]


def figures_of_rows(rows: pd.DataFrame, eval: EvaluationConfig) -> Figures:
    """Figures of the rows of `table1.traffic` and of real against real, with bootstrap intervals over scenes."""
    keys, values = [], []
    for figure in HEADINGS_ON_TRAFFIC:
        of_rows = scene_figures(rows, figure)
        wanted = [*named_rows(set(of_rows)), (PREFIX + REAL_VS_REAL, "", None)]
        for name, kind, policy in wanted:
            if np.isfinite(of_rows[name]).any():
                keys.append((name, figure, ""))
                values.append(of_rows[name])
                if policy is not None and figure in COMPARED_FIGURES:
                    keys.append((name, figure, "_less_base"))
                    values.append(of_rows[name] - of_rows[name_of(kind, None)])
    figures: dict[tuple[str, str], dict[str, float | None]] = {}
    for (name, figure, ending), (value, low, high) in zip(keys, means_with_intervals(values, eval), strict=True):
        figures.setdefault((name, figure), {}).update({ending: value, f"{ending}_low": low, f"{ending}_high": high})
    return figures


def long_rows_on_traffic(figures: Figures, n_scenes: int, *, has_found: bool) -> pd.DataFrame:
    """Rows of the long table of Table 1; `less_base` is the difference from the same traffic without REARL.

    `has_found`: the drivers have effects that discovery found.
    """
    titles = {PREFIX + REAL_VS_REAL: f"{TITLES[REAL_VS_REAL]}, not rescaled"}
    kinds = titles_of_kinds(has_found=has_found)
    for name, kind, policy in named_rows({name for name, _ in figures}):
        titles[name] = f"{kinds[kind]}: {TITLES_OF_POLICIES[policy]}"
    # Real against real, the first of the titles, comes last.
    order = {name: number for number, name in enumerate([*list(titles)[1:], next(iter(titles))])}
    records: list[dict[str, Any]] = []
    for name, figure in sorted(figures, key=lambda key: order[key[0]]):
        by_ending = figures[name, figure]
        unit = METRICS[figure].unit if figure in METRICS else _UNITS[figure]
        columns = {("ours" if not ending else ending.removeprefix("_")): value for ending, value in by_ending.items()}
        records.append(
            {"row": name, "title": titles[name], "metric": figure, "unit": unit, "n_scenes": n_scenes} | columns
        )
    return long_table(records)


def sections_on_traffic(table: pd.DataFrame, intervals: str) -> tuple[Section, ...]:
    """The section of the rows of `table1.traffic`, none without them; `intervals` names the intervals."""
    if table.empty:
        return ()
    title = f"Started as recorded, speeds not rescaled, the same thresholds in all rows; {intervals}"
    figures = beside_paper(title, table, HEADINGS_ON_TRAFFIC, _DIGITS)
    title = f"Difference from the same traffic without REARL, paired over scenes; {intervals}"
    headings = {name: HEADINGS_ON_TRAFFIC[name] for name in COMPARED_FIGURES}
    differences = less_base_table(title, table, headings, _DIGITS)
    return (Section("REARL on a better traffic model", tables=(figures, differences)),)

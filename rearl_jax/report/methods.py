"""The report on `rearl evaluate`: methods beside each other, what was intervened, what the words mean."""

import numpy as np
import pandas as pd

from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.evaluation.page import BETTER, CAPTIONS
from rearl_jax.evaluation.scores import NOISE_FLOOR, REAL, REAL_VS_REAL, TITLES, WITH_EFFECT, title_of
from rearl_jax.evaluation.tables import written
from rearl_jax.metrics import METRICS
from rearl_jax.report.content import Content, Section, number, sentence
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.study.report import NONE, Cell, Line, Shown

_COLUMNS = ("method", "metric", "value", "sd", "low", "high", "confidence", "n_scenes", "n_rollouts")
_INTERVENTIONS = ("triggered", "asked", *ACTION_NAMES, "inadmissible", "invalid")


def evaluation_content(study: FinishedStudy) -> Content:
    """What the report on an evaluation says.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    table = study.table("summary")
    study.needs(table, _COLUMNS, "summary.parquet")
    rows = list(dict.fromkeys(table["method"]))
    main = main_row(rows)
    sections = [_methods(table, rows), *_interventions(study), _definitions(table)]
    counts = table[table["method"] == main].iloc[0]
    return Content(
        title=f"{title_of(main)} against recorded traffic",
        result=_result(table, main),
        sections=tuple(sections),
        data=f"{counts['n_scenes']} held-out scenes, {counts['n_rollouts']} rollouts of {title_of(main)}; "
        f"{study.config.seeds}.",
        words=f"evaluate method={study.config.method.name}",
        captions=CAPTIONS,
    )


def main_row(rows: list[str]) -> str:
    """The row a study is about: with variants of a model the last method, else the first."""
    methods = [row for row in rows if row not in TITLES]
    return methods[-1] if any(row.endswith(WITH_EFFECT) for row in methods) else methods[0]


def _result(table: pd.DataFrame, main: str) -> str:
    """The Hellinger distance of the method, beside what it must be read against."""
    h = table[table["metric"] == "h"].set_index("method")
    if main not in h.index:
        return f"There is no Hellinger distance of {title_of(main)}."

    def figure(row: str, name: str = "value") -> str:
        return NONE if row not in h.index or pd.isna(h.loc[row, name]) else written(float(h.loc[row, name]), "h")

    text = f"The speeds of {title_of(main)} are a Hellinger distance of {figure(main)} ({figure(main, 'low')} to "
    text += f"{figure(main, 'high')}) from the recorded ones"
    if "less_base" in h and pd.notna(h.loc[main, "less_base"]):
        ends = (float(h.loc[main, f"less_base{end}"]) for end in ("", "_low", "_high"))
        text += ", a change of {:+.3f} ({:+.3f} to {:+.3f}) to base".format(*ends)
    return (
        f"{text}; recorded scenes are {figure(REAL_VS_REAL)} from each other, and chance alone makes "
        f"{figure(NOISE_FLOOR)}."
    )


def _methods(table: pd.DataFrame, rows: list[str]) -> Section:
    """All metrics of all rows, with the difference to base where there is one."""
    found = {(row["method"], row["metric"]): row for row in table.astype(object).to_dict("records")}
    compared = [row for row in rows if table.loc[table["method"] == row, "less_base"].notna().any()]
    lines = []
    for name, metric in METRICS.items():
        if any((row, name) in found for row in rows):
            cells = [_estimate(found.get((row, name)), name) for row in rows]
            cells += [_difference(found.get((row, name)), name) for row in compared]
            lines.append(Line(f"{metric.title} [{metric.unit}]", tuple(cells)))
    percent = f"{100 * float(table['confidence'].iloc[0]):g} %"
    headings = (*map(title_of, rows), *(f"{title_of(row)} less base" for row in compared))
    notes = (
        f"Means over scenes of means over runs, ± their standard deviation over runs; below, {percent} bootstrap "
        "intervals over scenes.",
        "For distances and errors smaller is closer, but nothing can be expected below real against real. Time "
        f"headway and lane-change rate describe traffic: compare with the column {TITLES[REAL]}, more is not better.",
    )
    return Section("Methods", tables=(Shown("Metrics by method", headings, tuple(lines)),), items=notes)


def _estimate(row: dict | None, name: str) -> Cell:
    if row is None:
        return Cell(NONE)
    spread = "" if pd.isna(row["sd"]) else f" ± {written(row['sd'], name)}"
    missing = pd.isna(row["low"]) or pd.isna(row["high"])
    ends = "" if missing else f"{written(row['low'], name)} to {written(row['high'], name)}"
    return Cell(written(row["value"], name) + spread, ends)


def _difference(row: dict | None, name: str) -> Cell:
    if row is None or pd.isna(row["less_base"]):
        return Cell(NONE)
    value, low, high = (row[f"less_base{end}"] for end in ("", "_low", "_high"))
    missing = pd.isna(low) or pd.isna(high)
    return Cell(_signed(value, name), "" if missing else f"{_signed(low, name)} to {_signed(high, name)}")


def _signed(value: float, name: str) -> str:
    return ("+" if value >= 0 else "") + written(value, name)


def _interventions(study: FinishedStudy) -> list[Section]:
    """What was detected and decided; nothing where nobody intervenes."""
    if not (study.path / "decisions.parquet").exists():
        return []
    decisions = study.table("decisions")
    study.needs(decisions, _INTERVENTIONS, "decisions.parquet")
    rows = decisions["method"] if "method" in decisions else [study.rows[0]["method"]] * len(decisions)
    lines = []
    for row, part in decisions.groupby(rows, sort=False, observed=True):
        totals = {name: int(part[name].to_numpy(np.int64).sum()) for name in _INTERVENTIONS}
        asked = totals.pop("asked")
        counts = [total for name, total in totals.items() if name != "triggered"]
        cells = [Cell(f"{100 * totals['triggered'] / len(part):.1f} %"), Cell(number(asked))]
        cells += [Cell(number(n), f"{100 * n / asked:.0f} %" if asked else "") for n in counts]
        lines.append(Line(title_of(str(row)), tuple(cells)))
    headings = ("triggered seconds", "decisions", *ACTION_NAMES, "not admissible", "invalid")
    explained = (
        "Share of the seconds of all rollouts in which the detection triggered; vehicles that were asked in them; what "
        "they were told, and how many answers could not be followed."
    )
    return [Section("Interventions", (explained,), (Shown("Decisions of the policy", headings, tuple(lines)),))]


def _definitions(table: pd.DataFrame) -> Section:
    """What each metric is."""
    present = set(table["metric"])
    lines = tuple(
        Line(metric.title, (Cell(name), Cell(BETTER[metric.direction.name]), Cell(sentence(metric.definition))))
        for name, metric in METRICS.items()
        if name in present
    )
    shown = Shown("Metrics", ("in the files", "better", "definition"), lines)
    return Section("What the metrics mean", tables=(shown,), is_folded=True)

"""Document of the budget: rows of the stated order, shares of the components, and the remaining error."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax._typing import SceneIndices
from rearl_jax.config.budget import REARL, START, StudyBudgetTask
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Cell, Emphasis, Row, Table, cell_with_interval, decimals, percent, sentence
from rearl_jax.evaluation.estimates import bootstrap_over
from rearl_jax.evaluation.remarks import Remarks, speed_bins
from rearl_jax.evaluation.scores import TITLES as REFERENCE_TITLES
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.metrics import METRICS
from rearl_jax.study.budget.components import TITLES
from rearl_jax.study.budget.figures import COLUMNS, DIGITS
from rearl_jax.study.budget.tables import FIRST, LAST, OF_REAL, REST, WHOLE
from rearl_jax.study.document import records_of

ROW_HEADINGS = {**HEADINGS, "position_error": "position error [m]"}
"""Figures of a row and their headings."""

MAIN_ERRORS = ("h", "{mape}", "position_error")
"""Errors in the findings; the second is that of `mape.definition`."""

CLEAR_LEAD = 0.95
"""Share of the orders in which a component must have the largest reduction for the order not to matter [-]."""

CAPTIONS = {
    "waterfall": "From Base to the row with all components: bars are shares (means over all possible orders) with "
    "their intervals, blue where the error falls and red where it rises, crosses the errors of the rows in the stated "
    "order. The grey line is real against real. Position errors begin with the row that starts as recorded."
}
"""Text below the figure."""


def document_of(table: pd.DataFrame, steps: pd.DataFrame, remarks: Remarks, *, generated: bool) -> Document:
    """The document of budget.parquet and steps.parquet; `generated` is true if any of the data were generated."""
    verdict, *findings = remarks.notes
    sections = (
        Section("Rows in the stated order", tables=(_rows(steps),)),
        Section("Shares in the reduction of each error", (_MEANING_OF_SHARES,), (_shares(table),)),
        Section("The remaining error", notes=tuple(findings)),
        Section("Shares by error, and reductions in the stated order", tables=tuple(_by_error(table)), is_folded=True),
        Section("Definitions", notes=remarks.definitions, is_folded=True),
    )
    return Document(
        title="Error budget of simulated scenes",
        verdict=verdict,
        sections=sections,
        command="study budget",
        generated=generated,
        data=remarks.data,
        sources=remarks.sources,
        captions=CAPTIONS,
    )


_MEANING_OF_SHARES = (
    "A share is the mean, over all admissible orders, of the reduction of the error when the component is added. "
    "Positive shares are towards the recording in every column. Shares sum to the total reduction. Where more is "
    "better, as for realism and likelihoods, all differences have the opposite sign."
)


Parts = Mapping[str, Mapping[str, Any]]
"""Records of an error in budget.parquet, by part."""


def _text(value: Any, error: str, sign: str = "") -> str:
    return decimals(value, DIGITS.get(error, METRICS[error].digits if error in METRICS else 3), sign)


def _cell(record: Mapping[str, Any] | None, error: str, sign: str = "") -> Cell:
    """A figure with its interval."""
    return cell_with_interval(*(_text((record or {}).get(name), error, sign) for name in ("value", "low", "high")))


def _rows(steps: pd.DataFrame) -> Table:
    """The rows of the stated order and the reference rows."""
    rows = tuple(
        Row(
            next(iter(figures.values()))["title"],
            tuple(_cell(figures.get(name), name) for name in ROW_HEADINGS),
            Emphasis.subdued if row in REFERENCE_TITLES else Emphasis.plain,
        )
        for row, figures in records_of(steps, column="figure").items()
    )
    return Table("Base with one component more in every row", tuple(ROW_HEADINGS.values()), rows)


def _shares(table: pd.DataFrame) -> Table:
    """The shares of all errors in one table."""
    errors = records_of(table, "error", "part")
    parts = [name for name in TITLES if any(name in of_error for of_error in errors.values())]
    titles = {**TITLES, WHOLE: "total reduction", OF_REAL: "real against real", REST: "rest less real against real"}
    titles |= {FIRST: "first row", LAST: "all components"}
    rows = []
    for part in (FIRST, *parts, WHOLE, LAST, OF_REAL, REST):
        sign = "" if part in (FIRST, LAST, OF_REAL) else "+"
        cells = tuple(_cell(of_error.get(part), error, sign) for error, of_error in errors.items())
        rows.append(Row(titles[part], cells, Emphasis.plain if part in parts else Emphasis.subdued))
    return Table("Shares of the components", tuple(COLUMNS[error].title for error in errors), tuple(rows))


def _by_error(table: pd.DataFrame) -> Iterable[Table]:
    """A table per error: shares, the reduction in the stated order, extremes over all orders."""
    headings = ("share", "in the stated order", "least", "most", "leads in")
    for error, rows_of_error in table.dropna(subset=["leads"]).groupby("error", sort=False):
        rows = []
        for record in rows_of_error.astype(object).to_dict("records"):
            reductions = tuple(Cell(_text(record[name], str(error), "+")) for name in ("stated", "least", "most"))
            leads = Cell(percent(record["leads"]), "of the orders")
            rows.append(Row(record["title"], (_cell(record, str(error), "+"), *reductions, leads)))
        yield Table(f"{COLUMNS[str(error)].title}, {rows_of_error['n_orders'].iloc[0]} orders", headings, tuple(rows))


def findings_of(table: pd.DataFrame, mape: str, components: Sequence[str]) -> tuple[str, ...]:
    """Findings computed from the figures: the verdict, then a paragraph per main error.

    Args:
        table: Content of budget.parquet.
        mape: The spacing error that decides, as in `MapeConfig.column`.
        components: The components, in the stated order.
    """
    divided = records_of(table, "error", "part")
    errors = [name.format(mape=mape) for name in MAIN_ERRORS]
    main = {error: divided[error] for error in errors if error in divided}
    if not main:
        return ("No main error has a value in all rows of the budget, so nothing can be divided.",)
    paragraphs = [_verdict(*next(iter(main.items())))]
    paragraphs += [_finding(error, parts) for error, parts in main.items()]
    missing = [
        _name(error) for error, column in COLUMNS.items() if error not in divided and column.reduced_by(components)
    ]
    if missing:
        paragraphs.append(f"Not divided, because some rows have no value: {', '.join(missing)}.")
    if _name("position_error") in missing:
        paragraphs.append(
            "Position errors need vehicles that are picked in the first snapshot and in the second, one second later. "
            "No vehicle is."
        )
    return tuple(paragraphs)


def _name(error: str) -> str:
    """Name of an error in a sentence, without its unit."""
    return COLUMNS[error].title.partition(" [")[0]


def _verdict(error: str, parts: Parts) -> str:
    """The result in one sentence."""
    leader = max((part for part in parts if part in TITLES), key=lambda part: parts[part]["value"])
    of_leader = f"{_inline(parts[leader], error)}, is that of {TITLES[leader]}"
    if parts[WHOLE]["value"] > 0:
        share = f"the largest share of this reduction, {of_leader}"
    elif parts[leader]["value"] > 0:
        share = f"it does not fall; the largest share that reduces it, {of_leader}"
    else:
        share = "it does not fall, and no component reduces it"
    beside = f"; recorded scenes are {_text(parts[OF_REAL]['value'], error)} apart" if OF_REAL in parts else ""
    ends = " to ".join(_text(parts[part]["value"], error) for part in (FIRST, LAST))
    return f"{_name(error)} goes from {ends} with all components; {share}{beside}."


def _finding(error: str, parts: Parts) -> str:
    """Sentences on the shares of the components in an error, on their order, and on the remaining error."""
    title, whole = _name(error), parts[WHOLE]
    sentences = [
        f"{title} goes from {_text(parts[FIRST]['value'], error)} ({parts[FIRST]['title']}) to "
        f"{_text(parts[LAST]['value'], error)} with all components, a reduction of {_inline(whole, error)}"
    ]
    shares = sorted((part for part in parts if part in TITLES), key=lambda part: -parts[part]["value"])
    sentences.append("shares: " + ", ".join(f"{TITLES[part]} {_inline(parts[part], error)}" for part in shares))
    return " ".join(map(sentence, (*sentences, _order(parts, shares), _rest(parts, error))))


def _order(parts: Parts, shares: Sequence[str]) -> str:
    """Sentence on whether the order of the components decides which component has the largest reduction."""
    leader = shares[0]
    leads, n_orders = float(parts[leader]["leads"]), int(parts[leader]["n_orders"])
    if n_orders == 1:
        return "these components can be added in one order only"
    stated = max(shares, key=lambda part: parts[part]["stated"])
    if leads >= CLEAR_LEAD and stated == leader:
        return (
            f"the order hardly matters: {TITLES[leader]} has the largest reduction in {percent(leads)} of {n_orders} "
            "orders"
        )
    in_stated_order = "" if stated == leader else f", in the stated one {TITLES[stated]}"
    return (
        f"the order decides which component looks largest: {TITLES[leader]} has the largest share, but the largest "
        f"reduction only in {percent(leads)} of {n_orders} orders{in_stated_order}"
    )


def _rest(parts: Parts, error: str) -> str:
    """Sentence on the remaining error, compared with real against real where that has a value."""
    if REST not in parts:
        left = f"no component explains the remaining {_inline(parts[LAST], error, '')}"
        needs_other_scene = error in METRICS and METRICS[error].compares
        reason = "there is no other recorded scene to compare with" if needs_other_scene else "recordings have 0"
        return f"{left}; {reason}"
    last, real, rest = parts[LAST], parts[OF_REAL], parts[REST]
    recorded = f"that of another recorded scene is {_text(real['value'], error)}"
    left = f"the remaining error, {_text(last['value'], error)},"
    if pd.isna(rest["low"]):
        return f"{left} has too few scenes for a comparison: {recorded}"
    if float(rest["low"]) > 0:
        more = f"no component explains the difference, {_inline(rest, error)}"
        return f"{left} is larger than between recorded scenes: {recorded}; {more}"
    if float(rest["high"]) < 0:
        return f"{left} is smaller than between recorded scenes: {recorded}; it need not be a fault of the simulation"
    return f"{left} does not differ significantly from that between recorded scenes: {recorded}"


def _inline(record: Mapping[str, Any], error: str, sign: str = "+") -> str:
    """A figure in a sentence."""
    return _cell(record, error, sign).inline


def definitions_of(config: StudyBudgetTask, scenes: SceneSet, held_out: SceneIndices) -> tuple[str, ...]:
    """Definitions of rows, starts, intervals and the vehicles of short scenes."""
    picked = scenes.track_id[held_out]  # [scenes, seconds, vehicles]
    # For each vehicle of the first snapshot, the seconds in which it is picked.
    stay = (picked[:, :, :, None] == picked[:, :1, None, :]).any(axis=2).sum(axis=1)
    return (
        f"Road: {config.core.n_vehicles} vehicles on {config.core.lanes} lanes in all rows.",
        "Base: highway-env's start, drawn by eval.seed, run and scene, and the drivers of the keys driver and mobil.",
        f"{TITLES[START]}: the first snapshot of the scene; desired speeds are at most the highest recorded "
        "speed of the vehicle, and exactly that for drivers without a desired speed of their own.",
        f"A vehicle of the first snapshot is picked for {np.median(stay):.0f} s of the {scenes.seconds} s of a scene "
        "(median). Without replayed vehicles the first vehicles are simulated to the end and compared with the picked "
        "ones; with them a vehicle leaves when it is no longer picked, and the vehicle that is picked instead enters "
        "as recorded. Position errors are those of the vehicles of the first snapshot while they are picked, in "
        "all rows alike.",
        f"{TITLES[REARL]}: decisions of the matcher where the traffic differs too much from its reference; the same "
        "thresholds in all rows, percentiles of Base on threshold scenes.",
        speed_bins(config.hist, scenes.scaled_speed[held_out]),
        "THW error and LCR error: distance of a scene's time headway and lane-change rate from the recorded scene's.",
        f"Intervals: {bootstrap_over(len(held_out), 'scored scenes', config.eval.confidence)}; the same resamples for "
        "every figure. An error is divided over the scenes that have it in all rows.",
    )

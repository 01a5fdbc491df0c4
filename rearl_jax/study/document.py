"""Document of a study of the paper: our figures, the paper's figures, and differences between the two.

A study writes one long table, with one line per row of the study and metric.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from rearl_jax.config import ClusterTask, EvaluateTask
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.document.document import Document, Section, data_sources
from rearl_jax.document.publishing import publish_document
from rearl_jax.document.table import (
    NONE,
    Cell,
    Emphasis,
    Row,
    Table,
    cell_with_interval,
    interval,
    number,
    percent,
    spoken,
)
from rearl_jax.evaluation.remarks import Remarks, data_summary
from rearl_jax.metrics import METRICS
from rearl_jax.results import Study, without_provenance
from rearl_jax.study.published import TABLE1

_LONGEST_FIGURE = 100
"""Longest text in summary.json that is a figure, not a paragraph [characters]."""

_DIGITS = {name: metric.digits for name, metric in METRICS.items()}

_FIGURES = ("ours", "low", "high", "sd", "less_base", "less_base_low", "less_base_high", "paper")


@dataclass(frozen=True)
class Form:
    """The parts of a study's document that differ between studies.

    Attributes:
        name: Name of the task after `study`, and of its long table.
        title: Title of its document, before the names of the data sets.
        sections: Function that makes its sections from the task's record, the long table and the summary.
        captions: Text below each figure, by name.
    """

    name: str
    title: str
    sections: Callable[[Any, pd.DataFrame, Mapping[str, Any]], tuple[Section, ...]]
    captions: Mapping[str, str]


def long_table(records: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """One line per row of the study and metric: `row`, `metric`, `ours`, `low`, `high`, `paper`, and further columns.

    Missing values are null, never NaN.
    """
    frame = pd.DataFrame(list(records))
    for name in _FIGURES:
        if name in frame:
            frame[name] = pd.array([None if pd.isna(value) else float(value) for value in frame[name]], "Float64")
    for name in frame.columns:
        if name.startswith("n_"):
            frame[name] = pd.array([None if pd.isna(value) else int(value) for value in frame[name]], "Int64")
    return frame


def remarks_on(
    config: EvaluateTask | ClusterTask, scenes: SceneSet, use: str, findings: Sequence[str], differences: Sequence[str]
) -> Remarks:
    """Remarks on the long table.

    Args:
        config: The task.
        scenes: All scenes.
        use: Number of scenes by purpose.
        findings: Conclusions from the figures; the first sentence is the verdict.
        differences: Differences from the paper besides the method, each as `name: text`.
    """
    data = data_summary(config, scenes, use)
    return Remarks(data, tuple(findings), tuple(differences), data_sources(scenes.infos))


def publish(
    study: Study,
    form: Form,
    config: Any,
    scenes: SceneSet | None,
    table: pd.DataFrame,
    summary: Mapping[str, Any],
    remarks: Remarks,
    draw: Callable[[], Mapping[str, bytes]],
    **metadata: str,
) -> None:
    """Writes `NAME.parquet` and publishes the document, see `publish_document`.

    `scenes` are None without data; `metadata` of the table come besides its provenance.
    """
    study.write_table(form.name, table, **metadata, remarks=remarks.to_json())
    generated = scenes is not None and scenes.generated
    document = document_of(form, config, table, summary, remarks, generated=generated)
    publish_document(study, document, config, summary, draw, data_id=scenes.data_id if scenes else None)


def document_of(
    form: Form, config: Any, table: pd.DataFrame, summary: Mapping[str, Any], remarks: Remarks, *, generated: bool
) -> Document:
    """The document of a study; arguments as in `publish`."""
    sources = ", ".join(source.name for source in remarks.sources)
    title = f"{form.title}, on {sources}" if sources else form.title
    verdict, *findings = remarks.notes or (f"{title}.",)
    if remarks.definitions:
        names = ", ".join(text.partition(":")[0] for text in remarks.definitions)
        findings.append(
            "Only the signs of differences and the order of methods can be compared with the paper; page.html lists "
            f"what differs: {names}."
        )
    other_figures = _other_figures(summary, table)
    return Document(
        title=title,
        verdict=verdict,
        sections=(
            *form.sections(config, table, summary),
            Section("What follows", notes=tuple(findings)),
            Section("What differs from the paper", notes=remarks.definitions, is_folded=True),
            Section("Other figures", tables=(other_figures,), is_folded=True),
        ),
        command=f"study {form.name}",
        generated=generated,
        data=remarks.data,
        sources=remarks.sources,
        captions=form.captions,
    )


def beside_paper(
    title: str, table: pd.DataFrame, headings: Mapping[str, str], digits: Mapping[str, int] | None = None
) -> Table:
    """Rows of a long table with a column per metric; the paper's figures are in a row below the last corresponding one.

    Args:
        title: Title of the table.
        table: The long table; its column `paper_row` names the corresponding row of the paper's Table 1.
        headings: Headings of the metrics.
        digits: Digits after the decimal point, for metrics outside `METRICS` or with other digits than there.
    """
    digits = _DIGITS | dict(digits or {})
    records = records_of(table)
    last_row_of = {paper_row: name for name, figures in records.items() if (paper_row := _paper_row(figures))}
    rows = []
    for name, figures in records.items():
        any_figure = next(iter(figures.values()))
        row_title, paper_row = str(any_figure.get("title", name)), _paper_row(figures)
        cells = tuple(cell(figures.get(metric), metric, digits=digits.get(metric)) for metric in headings)
        if not name.startswith("paper_"):
            rows.append(Row(row_title, cells))
        paper = tuple(cell(figures.get(metric), metric, "paper", digits=digits.get(metric)) for metric in headings)
        if any(cell.value != NONE for cell in paper) and (paper_row is None or last_row_of[paper_row] == name):
            row_title = TABLE1[paper_row].title if paper_row else row_title
            rows.append(Row(f"paper: {row_title}", paper, Emphasis.subdued))
    return Table(title, tuple(headings.values()), tuple(rows))


def less_base_table(
    title: str,
    table: pd.DataFrame,
    headings: Mapping[str, str],
    digits: Mapping[str, int] | None = None,
    counts: Mapping[str, str] | None = None,
) -> Table:
    """Differences from base: the rows of a long table that have any, with a column per metric.

    Args:
        title: Title of the table.
        table: The long table.
        headings: Headings of the metrics.
        digits: As in `beside_paper`.
        counts: Headings of further columns, whose numbers are the same for all metrics of a row.
    """
    digits, counts = _DIGITS | dict(digits or {}), counts or {}
    rows = []
    for figures in records_of(table).values():
        if any(pd.notna(figure.get("less_base")) for figure in figures.values()):
            any_figure = next(iter(figures.values()))
            cells = [cell(figures.get(name), name, "less_base", digits=digits[name], sign="+") for name in headings]
            cells += [Cell(number(any_figure.get(name))) for name in counts]
            rows.append(Row(str(any_figure["title"]), tuple(cells)))
    return Table(title, (*headings.values(), *counts.values()), tuple(rows))


def _paper_row(figures: Mapping[str, Mapping[str, Any]]) -> str | None:
    """The row of the paper's Table 1 that corresponds to a row of ours, from its figures; None if there is none."""
    names = (figure.get("paper_row") for figure in figures.values())
    return next((name for name in names if isinstance(name, str)), None)


def records_of(table: pd.DataFrame, row: str = "row", column: str = "metric") -> dict[str, dict[str, dict[str, Any]]]:
    """Records of a long table by the values of two of its columns."""
    rows: dict[str, dict[str, dict[str, Any]]] = {}
    for record in table.astype(object).to_dict("records"):
        rows.setdefault(record[row], {})[record[column]] = {str(name): value for name, value in record.items()}
    return rows


def cell(
    record: Mapping[str, Any] | None, metric: str, column: str = "ours", *, digits: int | None = None, sign: str = ""
) -> Cell:
    """A figure of a long table with its interval.

    Args:
        record: Row of the long table; None for none.
        metric: Name of the metric.
        column: `ours`, `paper` or `less_base`.
        digits: Digits after the point; None for three significant ones.
        sign: `+` for changes.
    """
    ends = ("low", "high") if column == "ours" else (f"{column}_low", f"{column}_high")
    value, low, high = ((record or {}).get(name) for name in (column, *ends))
    texts = (_text(end, metric, digits, sign) for end in (value, low, high))
    return cell_with_interval(*texts)


def _text(value: Any, metric: str, digits: int | None, sign: str) -> str:
    if value is None or pd.isna(value):
        return NONE
    if metric.startswith("is_"):
        return number(bool(value))
    if metric.endswith("_share"):
        return percent(value)
    return number(value, sign) if digits is None else f"{value:{sign},.{digits}f}"


def _other_figures(summary: Mapping[str, Any], table: pd.DataFrame) -> Table:
    """Figures of summary.json outside the long table, without provenance."""
    plain = {key: value for key, value in without_provenance(summary).items() if not isinstance(value, (list, dict))}
    left_out = ("_low", "_high", "_paper", "_sd")
    in_table = tuple(f"{row}_{metric}" for row, metric in zip(table["row"], table["metric"], strict=True))
    return Table(
        "Figures of summary.json",
        ("value",),
        tuple(
            Row(spoken(key), (Cell(number(value), interval(plain.get(f"{key}_low"), plain.get(f"{key}_high"))),))
            for key, value in plain.items()
            if not key.endswith(left_out)
            and not key.startswith(in_table)
            and value is not None
            and len(str(value)) <= _LONGEST_FIGURE
        ),
    )

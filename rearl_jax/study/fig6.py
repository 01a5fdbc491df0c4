"""The task `rearl study fig6`: errors of the methods second by second, in the form of the paper's Fig. 6.

The rows are those of Table 1. Writes `fig6.parquet` (one row per row, second and error), `fig6.png`, `page.html`,
`config.json` and, last of all, `summary.json`.
"""

from functools import partial
from typing import Any

import pandas as pd

from rearl_jax.config import StudyFig6Task
from rearl_jax.data.recordings import is_generated
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.tables import HEADINGS, source_names
from rearl_jax.evaluation.terminal import short
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.study.error_series import ErrorSeries, error_series
from rearl_jax.study.report import NONE, Cell, Line, Report, Shown, finish, long_table
from rearl_jax.study.row_results import evaluate_rows
from rearl_jax.study.table1 import page_data, what_differs

THIRDS = ("first", "middle", "last")
"""Parts of a rollout in the table."""

_CAPTION = (
    "One line per row of Table 1. Lines are means over rollouts and scenes, bands hold the middle 80 % of them; blue: "
    "the row, grey: real against real, dashed: base. The first Hellinger distance is that of the first full window."
)

CAPTIONS = {"fig6": _CAPTION}
"""What is below the figure."""


def run(config: StudyFig6Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.study.table1.run`.
    """
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "study fig6", inputs_id(config), generated=generated)
    study.write_config()
    results = evaluate_rows(config)
    with progress_bar() as bar:
        inputs = read_inputs(config, study, bar, with_references=results.has_references)
    metrics = ("h", config.mape.column)
    series = error_series(results, metrics)
    report = Report(
        title=f"Errors second by second, on {source_names(inputs.scenes)}",
        tables=(_shown(series, metrics, results.n_scenes),),
        findings=tuple(_findings(series, metrics)),
        differences=(
            "the paper's Fig. 6 itself is not at hand: nothing of it stands beside ours, only what it shows is shown",
            *what_differs(config, results, inputs),
        ),
        data=page_data(config, results, inputs),
        generated=generated,
        data_id=inputs.scenes.data_id,
        captions=CAPTIONS,
    )
    summary: dict[str, Any] = {"n_rows": len(results.rows), "n_scenes": results.n_scenes}
    for item in series:
        for metric in metrics:
            summary |= {f"{item.name}_{metric}_{third}": value for third, value in _thirds(item, metric).items()}
    seeds = config.seeds
    draw = partial(_draw, config, series, generated=generated)
    finish(study, "study fig6", config, report, _long(series, metrics), summary, draw, seeds=seeds)
    return summary


def _draw(config: StudyFig6Task, series: list[ErrorSeries], *, generated: bool) -> dict[str, bytes]:
    from rearl_jax.study.fig6_figure import draw_series

    return {"fig6": draw_series(series, ("h", config.mape.column), generated=generated)}


def _thirds(item: ErrorSeries, metric: str) -> dict[str, float | None]:
    """Mean of an error in each third of the rollout."""
    found = item.errors[metric]
    part = len(THIRDS) * found.second // (found.second.max() + 1)
    means = (found.mean[part == number] for number in range(len(THIRDS)))
    return {third: float(values.mean()) if len(values) else None for third, values in zip(THIRDS, means, strict=True)}


def _shown(series: list[ErrorSeries], metrics: tuple[str, str], n_scenes: int) -> Shown:
    headings = tuple(f"{HEADINGS[metric]}, {third} third" for metric in metrics for third in THIRDS)
    lines = []
    for item in series:
        values = [(metric, value) for metric in metrics for value in _thirds(item, metric).values()]
        cells = (Cell(NONE if value is None else short(value, metric)) for metric, value in values)
        lines.append(Line(item.title, tuple(cells)))
    return Shown(f"Fig. 6, means over the thirds of a rollout; {n_scenes} held-out scenes", headings, tuple(lines))


def _findings(series: list[ErrorSeries], metrics: tuple[str, str]) -> list[str]:
    """Whether the errors rise or fall in the course of a rollout."""
    said = []
    for metric in metrics:
        rising, falling = [], []
        for item in series:
            thirds = _thirds(item, metric)
            first, last = thirds["first"], thirds["last"]
            if first is None or last is None or first == last:
                continue
            (rising if last > first else falling).append(f"{item.title} ({last - first:+.3f})")
        said.append(
            f"{HEADINGS[metric]}, last less first third: higher in {', '.join(rising) or 'no row'}; lower in "
            f"{', '.join(falling) or 'no row'}."
        )
    return said


def _long(series: list[ErrorSeries], metrics: tuple[str, str]) -> pd.DataFrame:
    """`row`, `title`, `metric`, `second`, `ours` (mean), `low`, `high` (of the band), `paper` (missing), `n_values`."""
    records: list[dict[str, Any]] = []
    for item in series:
        for metric in metrics:
            found = item.errors[metric]
            keys = {"row": item.name, "title": item.title, "metric": metric, "paper": None}
            columns = (found.second, found.mean, found.low, found.high, found.n_values)
            names = ("second", "ours", "low", "high", "n_values")
            rows = zip(*(column.tolist() for column in columns), strict=True)
            records += [keys | dict(zip(names, row, strict=True)) for row in rows]
    return long_table(records)

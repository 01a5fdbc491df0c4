"""The table in the terminal."""

from rearl_jax.console import Console, as_text, print_notes, standard_output, titled_table
from rearl_jax.evaluation.estimates import Estimate
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.evaluation.tables import HEADINGS, SHOWN, source_names, table_notes, written

_WIDTH = 120
"""Columns the table with intervals needs."""


def print_table(evaluation: Evaluation, estimates: dict[tuple[str, str], Estimate]) -> None:
    """Prints the table people read; in a narrow terminal without intervals."""
    _show(standard_output(_WIDTH), evaluation, estimates)


def text_of(evaluation: Evaluation, estimates: dict[tuple[str, str], Estimate]) -> str:
    """The table as text without colours."""
    return as_text(_WIDTH, lambda console: _show(console, evaluation, estimates))


def _show(console: Console, evaluation: Evaluation, estimates: dict[tuple[str, str], Estimate]) -> None:
    has_room = console.width >= _WIDTH
    title = f"{evaluation.method.title} on {source_names(evaluation.scenes)}"
    table = titled_table(title, generated=evaluation.scenes.generated)
    table.add_column("", no_wrap=True)
    for name in SHOWN:
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    for row in evaluation.rows:
        cells = (_cell(estimates.get((row.row, name)), name, has_room) for name in SHOWN)
        table.add_row(row.title, *cells)
    console.print(table)
    print_notes(console, table_notes(evaluation.config, evaluation, estimates))
    if not has_room:
        console.print(f"intervals: page.html, or a terminal of {_WIDTH} columns", highlight=False)


def _cell(estimate: Estimate | None, name: str, has_room: bool) -> str:
    """A figure with its spread over runs, and below it the interval where there is room."""
    if estimate is None:
        return "-"
    spread = "" if estimate.sd is None else f"±{short(estimate.sd, name)}"
    figure = short(estimate.value, name)
    lines = [figure + spread] if has_room else [figure, spread]
    if has_room and estimate.low is not None and estimate.high is not None:
        lines.append(f"[dim]{short(estimate.low, name)}–{short(estimate.high, name)}[/dim]")
    return "\n".join(lines)


def short(value: float, name: str) -> str:
    """A figure without the zero before its point, so that eight metrics fit side by side."""
    text = written(value, name)
    return text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text

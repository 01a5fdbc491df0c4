"""The table in the terminal."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from rearl_jax.config import EvaluateTask
from rearl_jax.evaluation.estimates import Estimate
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.evaluation.tables import HEADINGS, SHOWN, source_names, table_notes, written

_WIDTH = 114
"""Columns the table with intervals needs."""


def print_table(config: EvaluateTask, evaluation: Evaluation, estimates: dict[tuple[str, str], Estimate]) -> None:
    """Prints the table people read; in a narrow terminal without intervals."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH)  # a file or a pipe has no width of its own
    has_room = console.width >= _WIDTH
    title = f"{config.method.name} on {source_names(evaluation)}"
    if evaluation.scenes.generated:
        title += " (GENERATED recordings)"
    style = {"title_justify": "left", "title_style": "bold", "box": SIMPLE_HEAD, "padding": (0, 1, 0, 0)}
    table = Table(title=title, **style)
    table.add_column("", no_wrap=True)
    for name in SHOWN:
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    for row in evaluation.rows:
        cells = (_cell(estimates.get((row.row, name)), name, has_room) for name in SHOWN)
        table.add_row(row.title, *cells)
    console.print(table)
    for note in table_notes(config, evaluation):
        console.print(note, highlight=False, markup=False)
    if not has_room:
        console.print(f"intervals: page.html, or a terminal of {_WIDTH} columns", highlight=False)


def _cell(estimate: Estimate | None, name: str, has_room: bool) -> str:
    """A figure with its spread over runs, and below it the interval where there is room."""
    if estimate is None:
        return "-"
    spread = "" if estimate.sd is None else f"±{_short(estimate.sd, name)}"
    figure = _short(estimate.value, name)
    lines = [figure + spread] if has_room else [figure, spread]
    if has_room and estimate.low is not None and estimate.high is not None:
        lines.append(f"[dim]{_short(estimate.low, name)}–{_short(estimate.high, name)}[/dim]")
    return "\n".join(lines)


def _short(value: float, name: str) -> str:
    """A figure without the zero before its point, so that eight metrics fit side by side."""
    text = written(value, name)
    return text[1:] if text.startswith("0.") else text

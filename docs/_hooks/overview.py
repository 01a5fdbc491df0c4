"""Draws the picture of README and of the first page from the stored results: `python docs/_hooks/overview.py`.

Left: share of hidden effects that discovery names, by their strength, in generated recordings. Right: gap error of
drivers of a measured recording that were not used in the fit, over the second half of their drives, by the source of
their parameters.
"""

import json
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "results" / "kept"
PICTURE = ROOT / "docs" / "overview.svg"

WIDTH, HEIGHT = 800, 280
TOP, BOTTOM = 60, 230
"""Upper and lower end of both panels [px]."""

LEFT_PANEL, RIGHT_PANEL = (60, 390), (560, 780)
"""First and last abscissa of the panels [px]."""

DARK, GREY, BLUE, ORANGE = "#333333", "#bbbbbb", "#0072b2", "#d55e00"
LARGEST_ERROR = 8.0
"""End of the axis of the right panel [m]."""

STRENGTHS = {0.25: "1/4", 0.5: "1/2", 1.0: "1", 2.0: "2"}
STUDY = "discover_i80"
KNOWN = {"population": "the population", "before": "own first half", "after": "same, repaired model"}
"""Labels of the bars: source of a driver's parameters, and simulated model."""


def draw() -> str:
    """The picture as SVG, the same text for the same results."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'font-family="sans-serif" font-size="12">'
    )
    background = f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    return "\n".join([head, background, *_named_by_strength(), *_gap_errors(), "</svg>"]) + "\n"


def _named_by_strength() -> list[str]:
    """Left panel: share of the data sets with one hidden effect in which discovery names it, with 95 % intervals."""
    table = pd.read_parquet(KEPT / "blind_fourth" / "strengths.parquet")
    rows = table[table["effect"] == "all"].set_index("strength")
    first, last = LEFT_PANEL
    parts = [_text(first, 22, "GENERATED recordings: hidden effects found", weight="bold")]
    for share in (0.0, 0.5, 1.0):
        y = _height(share)
        parts += [_line(first, y, last, y, GREY), _text(first - 8, y + 4, f"{100 * share:.0f} %", anchor="end")]
    for number, (strength, label) in enumerate(STRENGTHS.items()):
        row, x = rows.loc[strength], first + 50 + 80 * number
        parts += [
            _line(x, _height(row["low"]), x, _height(row["high"]), BLUE, 2),
            _dot(x, _height(row["rate"]), BLUE),
            _text(x, BOTTOM + 18, label, anchor="middle"),
            _text(x + 8, _height(row["rate"]) + 16, f"{row['n_named']:.0f} of {row['n']:.0f}"),
        ]
    return [
        *parts,
        _text(
            (first + last) / 2, BOTTOM + 38, "strength / usual strength of the effect (95 % intervals)", anchor="middle"
        ),
    ]


def _gap_errors() -> list[str]:
    """Right panel: mean root mean square error of the gap in the second half of a drive, with intervals."""
    first, last = RIGHT_PANEL
    error = json.loads((KEPT / STUDY / "verdict.json").read_text(encoding="utf-8"))["error"]["protocols"]["first_half"]
    title = f"MEASURED, I-80: gap error of {error['n_drivers']} other drivers"
    parts = [_text(first - 115, 22, title, weight="bold"), _text(first - 115, 40, "second half of a drive, from")]
    for value in (0.0, 2.0, 4.0, 6.0, 8.0):
        x = _along(value)
        parts += [_line(x, TOP, x, BOTTOM, GREY), _text(x, BOTTOM + 18, f"{value:.0f}", anchor="middle")]
    for number, (state, name) in enumerate(KNOWN.items()):
        value, y, colour = error["gap_rmse"]["mean"][state], TOP + 35 + 55 * number, BLUE if number else ORANGE
        parts += [
            _text(first - 8, y + 4, name, anchor="end"),
            _line(_along(value["low"]), y, _along(value["high"]), y, colour, 2),
            _dot(_along(value["value"]), y, colour),
            _text(_along(value["value"]), y - 7, f"{value['value']:.2f} m", anchor="middle"),
        ]
    return [
        *parts,
        _text(last, BOTTOM + 38, "root mean square error of the gap [m] (90 % intervals)", anchor="end"),
    ]


def _height(share: float) -> float:
    return BOTTOM - (BOTTOM - TOP) * share


def _along(error: float) -> float:
    first, last = RIGHT_PANEL
    return first + (last - first) * error / LARGEST_ERROR


def _text(x: float, y: float, words: str, **style: str) -> str:
    anchor, weight = style.get("anchor", "start"), style.get("weight", "normal")
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-weight="{weight}" fill="{DARK}">{words}</text>'


def _line(x: float, y: float, to_x: float, to_y: float, colour: str, width: int = 1) -> str:
    return f'<path d="M{x:.1f} {y:.1f}L{to_x:.1f} {to_y:.1f}" stroke="{colour}" stroke-width="{width}"/>'


def _dot(x: float, y: float, colour: str) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>'


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")

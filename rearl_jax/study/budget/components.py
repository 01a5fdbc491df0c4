"""Components of the budget: their titles, the orders in which they can be added, and the sets of components that occur
in these orders, the rows of the budget.

A component that needs another one is added after it in every order (Faigle & Kern, Int. J. Game Theory 21 (1992) 249:
Shapley values under precedence constraints).
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import permutations

from rearl_jax.config.budget import (
    BOUNDARY,
    CALIBRATED,
    COMPONENTS,
    FOUND,
    LANE_CHANGES,
    NEEDS,
    REARL,
    START,
    VARIATION,
)

TITLES: Mapping[str, str] = {
    START: "start and desired speeds as recorded",
    BOUNDARY: "replayed neighbours",
    CALIBRATED: "calibrated drivers",
    FOUND: "what discovery found",
    LANE_CHANGES: "calibrated lane changes",
    VARIATION: "variation within drivers",
    REARL: "REARL's matcher",
}
"""Titles of the components in tables and figures."""

BASE = "base"
"""Name of the row without components."""

Row = frozenset[str]
"""A row of the budget: a set of components."""


def orders(components: Iterable[str]) -> list[tuple[str, ...]]:
    """All orders in which every component comes after the one it needs."""
    return [
        order
        for order in permutations(components)
        if all(NEEDS.get(name) in (None, *order[:position]) for position, name in enumerate(order))
    ]


def rows_of(components: Sequence[str]) -> list[Row]:
    """All sets of components that occur in some order, small ones first."""
    rows = {frozenset(order[:size]) for order in orders(components) for size in range(len(components) + 1)}
    return sorted(rows, key=lambda row: (len(row), [COMPONENTS.index(name) for name in names_of(row)]))


def names_of(row: Row) -> list[str]:
    """Names of the components of a row, in the order of `COMPONENTS`."""
    return [name for name in COMPONENTS if name in row]


def row_name(row: Row) -> str:
    """Name of a row in tables: its components joined by +, `base` without any."""
    return "+".join(names_of(row)) or BASE


def title_of_row(row: Row) -> str:
    """Title of a row: its components in words, `base` without any."""
    return " + ".join(TITLES[name] for name in names_of(row)) or BASE


def row_of(name: str) -> Row:
    """The row with a name."""
    return frozenset() if name == BASE else frozenset(name.split("+"))

"""Description of a metric: its name, unit and definition, which way is better, and what it can be measured on."""

from dataclasses import dataclass
from enum import Enum


class Direction(Enum):
    """Which way is better.

    `none`: the figure describes traffic, and the reference is the same figure of the real scenes. A higher time headway
    or lane-change rate is never better in itself.
    """

    lower = "lower"
    higher = "higher"
    none = "none"


@dataclass(frozen=True)
class Metric:
    """One row of the metric table.

    Attributes:
        name: Column of the result tables.
        title: Title in tables and figures.
        unit: "1" for none.
        direction: Which way is better.
        definition: One line.
        source: Where the definition comes from.
        compares: Whether it compares two scenes; a scene compared with itself says nothing.
        needs_lanes: Whether recordings without lanes have no such figure.
        digits: After the decimal point, in tables for people.
    """

    name: str
    title: str
    unit: str
    direction: Direction
    definition: str
    source: str
    compares: bool = False
    needs_lanes: bool = False
    digits: int = 3

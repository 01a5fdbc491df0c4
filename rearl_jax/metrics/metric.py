"""Description of a metric: name, unit, definition, direction of improvement, and required data."""

from dataclasses import dataclass
from enum import Enum


class Direction(Enum):
    """Direction of improvement.

    `none`: the figure describes traffic, and the reference is the same figure of the recorded scenes. A higher time
    headway or lane-change rate is never better in itself.
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
        unit: Unit; "1" for none.
        direction: Direction of improvement.
        definition: Definition in one line.
        source: Source of the definition.
        compares: Whether the metric compares two scenes; it is then undefined for a single scene.
        needs_lanes: Whether the metric needs lanes in the recording.
        digits: Digits after the decimal point in tables of documents.
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

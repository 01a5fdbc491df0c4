"""Lengths and widths of the vehicles of an unknown table, and their units."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rearl_jax.data.survey.clock import named
from rearl_jax.data.survey.sample import FoundColumn
from rearl_jax.data.tables.usual_names import unit_in
from rearl_jax.data.units import SI_FACTOR

RANGES = {
    "length": {"m": (3.0, 9.5), "ft": (10.0, 31.0), "cm": (300.0, 950.0)},
    "width": {"m": (1.2, 2.9), "ft": (4.0, 9.5), "cm": (120.0, 290.0)},
}
"""Median sizes of vehicles, by unit."""
# Smallest lower quartile, relative to the smallest plausible median. Below it, a quarter of the sizes may be in another
# unit, for example those of one carriageway.
_LEAST_QUARTILE = 0.6


@dataclass(frozen=True)
class Size:
    """A column of lengths or widths, its unit, and the reason for both."""

    column: FoundColumn
    unit: str
    why: str

    @property
    def median(self) -> float:
        """Median [m]."""
        return float(np.nanmedian(self.column.values)) * SI_FACTOR[self.unit]


@dataclass(frozen=True)
class Sizes:
    """Columns of lengths and widths by canonical name, and reasons for leaving out others by their name in the file."""

    taken: dict[str, Size] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)

    @property
    def unit(self) -> str | None:
        """Unit of the sizes, m or ft; None if it is unknown."""
        units = (size.unit for size in self.taken.values() if size.unit in ("m", "ft"))
        return next(units, None)


def sizes_of(columns: Sequence[FoundColumn]) -> Sizes:
    """The lengths and widths among columns."""
    found = Sizes()
    numbers = [column for column in columns if column.kind == "numbers"]
    candidates = {name: named(numbers, name) for name in RANGES}
    texts = [column for column in columns if column.kind != "numbers"]
    found.refused.update({column.name: "holds no numbers" for name in RANGES for column in named(texts, name)})
    boxes = None if candidates["length"] else _boxes(candidates["width"], numbers)
    if boxes is not None:
        candidates = {"length": [boxes[0]], "width": [boxes[1]]}
    for name, column in ((name, found_columns[0]) for name, found_columns in candidates.items() if found_columns):
        low, median = (float(quantile) for quantile in np.nanquantile(column.values, (0.25, 0.5)))
        stated = unit_in(column.name, "m")
        unit = stated or unit_of_median(name, median)
        if not stated and unit is not None and low < _LEAST_QUARTILE * RANGES[name][unit][0]:
            unit = unit_of_median(name, low)
        has_feet = "length" in found.taken and found.taken["length"].unit == "ft"
        box = "" if boxes is None else "; of a box in a picture, as in highD"
        if unit is None:
            found.refused[column.name] = f"the median is {median:.4g}, which is no {name} of vehicles in m, ft or cm"
        elif name == "width" and not stated and unit == "ft" and not has_feet:
            found.refused[column.name] = f"the median {median:.4g} may be a width in ft or a length in m"
        else:
            why = f"name; median {median:.4g}" + ("" if stated else f", that of vehicles in {unit}") + box
            found.taken[name] = Size(column, unit, why)
    if len(found.taken) == 2 and found.taken["width"].median >= found.taken["length"].median:
        why = "vehicles would be wider than long: length and width are interchanged, or in different units"
        found.refused.update({size.column.name: why for size in found.taken.values()})
        found.taken.clear()
    return found


def unit_of_median(canonical: str, median: float) -> str | None:
    """Unit in which the median length or width is that of vehicles; None if neither m, ft nor cm fits."""
    return next((unit for unit, (low, high) in RANGES[canonical].items() if low <= median <= high), None)


def _boxes(widths: Sequence[FoundColumn], numbers: Sequence[FoundColumn]) -> tuple[FoundColumn, FoundColumn] | None:
    """Length and width of boxes in a picture whose x is along the road, called width and height as in highD."""
    heights = [column for column in numbers if column.name.casefold() == "height"]
    if not widths or not heights:
        return None
    width, height = (float(np.nanmedian(column.values)) for column in (widths[0], heights[0]))
    is_box = unit_of_median("length", width) is not None and unit_of_median("width", height) is not None
    return (widths[0], heights[0]) if is_box and width > height else None

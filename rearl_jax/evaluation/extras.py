"""Results that only some methods have, in addition to those of every evaluation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import pandas as pd

Figures: TypeAlias = Mapping[str, str | int | float | None]
"""Keys of summary.json and their values."""


@dataclass(frozen=True)
class Extra:
    """Results of one part of a method.

    Attributes:
        tables: Parquet tables by name.
        notes: Notes below the table.
        summary: Keys of the method's object in summary.json; the other rows get None.
        figures: Functions that draw PNG files, by name; called when the table is printed, as drawing takes a while to
            import. `document.py` has a caption for each.
    """

    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    summary: Figures = field(default_factory=dict)
    figures: Mapping[str, Callable[[], bytes]] = field(default_factory=dict)

"""Report on the export of each part of a model: its place in the other program, or why it has none."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd

from rearl_jax.core.effects import EFFECTS


@dataclass(frozen=True)
class Said:
    """One part of a model.

    Attributes:
        what: Parameter or effect of the model.
        where: Attribute of the other program that holds it; None without a counterpart.
        remark: Accuracy of the translation, or why there is none; empty if it is exact.
    """

    what: str
    where: str | None
    remark: str = ""


@dataclass(frozen=True)
class Exported:
    """A model in the form of another program.

    Attributes:
        text: Content of the file.
        said: Report on each part of the model.
    """

    text: str
    said: tuple[Said, ...]


def said_table(said: Sequence[Said]) -> pd.DataFrame:
    """One row per part of a model: `what`, `where` (null without a counterpart), `remark`."""
    return pd.DataFrame([(part.what, part.where, part.remark) for part in said], columns=["what", "where", "remark"])


def unsaid_effects(names: Iterable[str], program: str) -> list[Said]:
    """Report on effects without a counterpart in a program.

    Args:
        names: Names of the effects.
        program: Name of the program.
    """
    reasons = {
        "driver": f"{program}'s car following has no such term",
        "generic": f"{program}'s car following has no such term",
        "random": f"{program}'s car following has no such random term",
        "road": "belongs to the road, not to its drivers: put it into the network",
        "lane_change": f"{program}'s lane changing has no such term",
    }
    return [Said(name, None, reasons[EFFECTS[name].kind]) for name in names]

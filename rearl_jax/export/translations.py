"""Translation of each part of a model into another program: its place there, or why it has none."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd

from rearl_jax.core.effects import EFFECTS


@dataclass(frozen=True)
class Translation:
    """Translation of one part of a model, or of one attribute of a file that is imported.

    Attributes:
        what: Parameter or effect of the model; for an import the attribute.
        where: Its counterpart in the other program, for an import in the model; None for none.
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
        translations: That of each part of the model.
    """

    text: str
    translations: tuple[Translation, ...]


def translation_table(translations: Sequence[Translation]) -> pd.DataFrame:
    """One row per part of a model: `what`, `where` (null without a counterpart), `remark`."""
    rows = [(part.what, part.where, part.remark) for part in translations]
    return pd.DataFrame(rows, columns=["what", "where", "remark"])


def untranslated_effects(names: Iterable[str], program: str) -> list[Translation]:
    """Translations of the effects with these names, which have no counterpart in a program."""
    reasons = {
        "driver": f"{program}'s car following has no such term",
        "generic": f"{program}'s car following has no such term",
        "random": f"{program}'s car following has no such random term",
        "road": "belongs to the road, not to its drivers: put it into the network",
        "lane_change": f"{program}'s lane changing has no such term",
    }
    return [Translation(name, None, reasons[EFFECTS[name].kind]) for name in names]

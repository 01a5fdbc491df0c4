"""Configuration of the blind study of discovery."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


class StudySize(Enum):
    """How many data sets are generated."""

    small = "small"
    medium = "medium"
    full = "full"


@dataclass(unsafe_hash=True)
class BlindConfig:
    """Data sets whose hidden effects discovery has to find"""

    size: StudySize = key(StudySize.small, "data sets of a study; small: one per question, medium: 141, full: 802")
    seed: int | None = key(
        None, "master seed of all data sets; null: drawn when the study begins, after the code's hash is written down"
    )
    sets: str = key("*", "shell pattern on the sets that are run, such as control* or half; * takes all")
    first: int | None = key(
        None,
        "data sets that are run and judged, the first of the study's random order; null: all. A study goes on from "
        "what it has when more are asked for",
    )
    sumo: bool = key(True, "generate data sets with SUMO too, in the sizes that have any; needs the extra `bench`")
    oracle: bool = key(False, "after each verdict, refit with what was hidden, to know the smallest error there is")
    keep_data: bool = key(False, "leave the generated recordings in the study's folder instead of removing them")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if self.seed is not None and not 0 <= self.seed < 2**32:
            raise out_of_range("seed", f"must be within 0 and {2**32 - 1} or null", self.seed)
        if self.first is not None and self.first < 1:
            raise out_of_range("first", "must be at least 1 or null", self.first)
        if not self.sets:
            raise out_of_range("sets", "must be a shell pattern such as *", repr(self.sets))

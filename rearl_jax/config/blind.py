"""Configuration of the blind study of discovery."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least
from rearl_jax.problems import out_of_range


class StudySize(Enum):
    """Number of data sets."""

    small = "small"
    medium = "medium"
    full = "full"


@dataclass(unsafe_hash=True)
class BlindConfig:
    """Data sets with hidden effects"""

    size: StudySize = key(StudySize.small, "number of data sets; small: one per question, medium: 141, full: 802")
    seed: int | None = key(
        None, "master seed of all data sets; null = drawn when the study starts, after the hash of the code is written"
    )
    sets: str = key("*", "shell pattern of the sets to run, such as control* or half; * = all")
    first: int | None = key(
        None,
        "number of data sets to run, from the beginning of the random order; null = all. A larger number later "
        "continues the study",
    )
    sumo: bool = key(True, "also generate data sets with SUMO, if the size includes them; needs the extra `bench`")
    oracle: bool = key(False, "after each verdict, refit with the hidden effect to know the smallest possible error")
    keep_data: bool = key(False, "keep the generated recordings in the folder of the study")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if self.seed is not None and not 0 <= self.seed < 2**32:
            raise out_of_range("seed", f"must be within 0 and {2**32 - 1} or null", self.seed)
        check_least(self, 1, "first")
        if not self.sets:
            raise out_of_range("sets", "must be a shell pattern such as *", repr(self.sets))

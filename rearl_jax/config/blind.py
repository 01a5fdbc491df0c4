"""Configuration of the blind study of discovery."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_within
from rearl_jax.problems import out_of_range


class StudySize(Enum):
    """Number of data sets."""

    small = "small"
    medium = "medium"
    full = "full"


class StudyPriors(Enum):
    """Source of the drivers, the measurement and the traffic of a data set."""

    usual = "usual"
    broad = "broad"


@dataclass(unsafe_hash=True)
class BlindConfig:
    """Data sets with hidden effects"""

    priors: StudyPriors = key(
        StudyPriors.usual,
        "drivers, measurement and traffic of the data sets; usual: IDM drivers, one noise and smoothing; broad: "
        "car-following model, population, noise, smoothing, density and duration drawn for every data set",
    )
    size: StudySize = key(
        StudySize.small, "number of data sets with blind.priors=usual; small: 6, medium: 141, full: 802"
    )
    n_sets: int = key(12, "number of data sets with blind.priors=broad; a quarter of them are controls")
    width: float = key(1.0, "width of the broad priors, as a multiple of the documented ones [-]")
    followers: int | None = key(None, "followers in a data set with broad priors; null = drawn")
    duration: float | None = key(None, "recorded time of a data set with broad priors [s]; null = drawn")
    seed: int | None = key(
        None, "master seed of all data sets; null = drawn when the study starts, after the hash of the code is written"
    )
    sets: str = key("*", "shell pattern of the sets to run, such as control* or half; * = all")
    first: int | None = key(
        None,
        "number of data sets to run, from the beginning of the random order; null = all. A larger number later "
        "continues the study",
    )
    sumo: bool = key(
        True, "also generate data sets with SUMO, if the size or the broad priors include them; needs the extra `bench`"
    )
    oracle: bool = key(False, "after each verdict, refit with the hidden effect to know the smallest possible error")
    keep_data: bool = key(False, "keep the generated recordings in the folder of the study")

    def check(self) -> None:
        if self.seed is not None and not 0 <= self.seed < 2**32:
            raise out_of_range("seed", f"must be within 0 and {2**32 - 1} or null", self.seed)
        check_least(self, 1, "first", "n_sets")
        check_least(self, 12, "followers")
        check_least(self, 20.0, "duration")
        check_finite(self, "duration")
        check_within(self, 0.1, 3.0, "width")
        if not self.sets:
            raise out_of_range("sets", "must be a shell pattern such as *", repr(self.sets))

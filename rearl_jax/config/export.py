"""Keys of models that leave for other programs or come from them."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least, check_positive, check_within


class Target(Enum):
    """Program that an exported model is written for."""

    sumo = "sumo"
    """An additional file of SUMO with a distribution of vehicle types."""
    highway_env = "highway_env"
    """A JSON list of attributes of highway-env's IDMVehicle."""


@dataclass(unsafe_hash=True)
class ExportConfig:
    """Drawn drivers, and their comparison in SUMO"""

    n_types: int = key(100, "drivers drawn from the population, each as probable as the others; own choice")
    seed: int = key(0, "seed of the drawn drivers, and of the comparison")
    compare: bool = key(False, "simulate the exported drivers in SUMO and here behind the same leaders; to=sumo only")
    n_leaders: int = key(20, "measured first vehicles of the comparison, taken from the recordings of data; own choice")
    n_followers: int = key(10, "followers of each; own choice")
    seconds: int = key(60, "simulated time of the comparison [s]; as a scene of REARL (Bi et al.)")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        check_least(self, 1, "n_types", "n_leaders", "n_followers", "seconds")
        check_within(self, 0, 2**31 - 4, "seed")


@dataclass(unsafe_hash=True)
class SumoFileConfig:
    """Vehicle types of SUMO that become drivers"""

    file: str | None = key(None, "file of SUMO with vType elements: a route file, an additional file")
    types: str = key("*", "ids of the types that are read, or of their distributions, as a pattern with * and ?")
    speed_limit: float | None = key(
        None, "limit of the roads they drive on [m/s], which speedFactor multiplies; null: maxSpeed alone counts"
    )

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        check_positive(self, "speed_limit")

"""Configuration of the tasks that write drivers for other programs and read them: `rearl export`, `rearl import`."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config import ResultsConfig
from rearl_jax.config._key import group_key, key, study_key
from rearl_jax.config._one_population import check_one_population, platoons
from rearl_jax.config._ranges import check_finite, check_least, check_positive, check_within
from rearl_jax.config.data import DataConfig
from rearl_jax.config.driver import DriverConfig, record_of
from rearl_jax.config.evaluation import ONE_VARIANT_HELP, Variant
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.problems import out_of_range


class Target(Enum):
    """Program that an exported model is written for."""

    sumo = "sumo"
    """An additional file of SUMO with a distribution of vehicle types."""
    highway_env = "highway_env"
    """A JSON list of attributes of highway-env's IDMVehicle."""
    openscenario = "openscenario"
    """A catalogue of controllers in OpenSCENARIO XML."""


@dataclass(unsafe_hash=True)
class ExportConfig:
    """Drawn drivers, and their comparison in SUMO"""

    n_types: int = key(100, "drivers drawn from the population, all equally probable")
    eidm: bool = key(False, "write SUMO's EIDM, with perception errors, in place of IDM; driver=idm and to=sumo only")
    seed: int = key(0, "seed of the drawn drivers, and of the comparison")
    compare: bool = key(False, "simulate the exported drivers in SUMO and here behind the same leaders; to=sumo only")
    n_leaders: int = key(20, "recorded vehicles that lead in the comparison: first vehicles of the platoons of data")
    n_followers: int = key(10, "followers behind each of these vehicles")
    seconds: int = key(60, "simulated time of the comparison [s]; as a scene of REARL (Bi et al.)")

    def check(self) -> None:
        check_least(self, 1, "n_types", "n_leaders", "n_followers", "seconds")
        check_within(self, 0, 2**31 - 4, "seed")  # the comparison also uses seed + 1 and seed + 2


@dataclass(unsafe_hash=True)
class SumoFileConfig:
    """Vehicle types of SUMO that become drivers"""

    file: str | None = key(None, "file of SUMO with vType elements: a route file, an additional file")
    types: str = key("*", "ids of the types or type distributions that are read, as a pattern with * and ?")
    speed_limit: float | None = key(
        None,
        "speed limit of the roads [m/s]; the desired speed is at most this times speedFactor; null: it is maxSpeed",
    )

    def check(self) -> None:
        check_positive(self, "speed_limit")
        check_finite(self, "speed_limit")


@dataclass(unsafe_hash=True)
class ExportTask:
    """Drivers for other programs."""

    study: str = study_key("export")
    to: Target = key(Target.sumo, "program that the drivers are written for")
    model: str | None = key(
        None, "repaired model, a model.yaml written by `rearl discover`; null = the drivers of `driver` and `mobil`"
    )
    variant: Variant = key(Variant.repaired, ONE_VARIANT_HELP)
    results: ResultsConfig = group_key(ResultsConfig)
    data: DataConfig = key(platoons, "Recordings of the first vehicles of export.compare")
    driver: DriverConfig = key(
        record_of("idm"), "Car following, sizes and classes of the drivers; driver=NAME chooses the model"
    )
    mobil: MobilConfig = group_key(MobilConfig)
    export: ExportConfig = group_key(ExportConfig)

    def check(self) -> None:
        """Raise InvalidInputError for drivers given by model and driver, variant=all, or keys of another target."""
        has_drivers = self.driver != record_of("idm")()
        check_one_population(self.variant, self.model, "a file holds one population", has_drivers=has_drivers)
        if self.export.compare and self.to is not Target.sumo:
            message = "must be false: only exported drivers of to=sumo are compared"
            raise out_of_range("export.compare", message, True)
        if self.export.eidm and self.to is not Target.sumo:
            raise out_of_range("export.eidm", "must be false: EIDM is a model of to=sumo", True)


@dataclass(unsafe_hash=True)
class ImportTask:
    """Drivers from another program."""

    study: str = study_key("import")
    results: ResultsConfig = group_key(ResultsConfig)
    sumo: SumoFileConfig = group_key(SumoFileConfig)

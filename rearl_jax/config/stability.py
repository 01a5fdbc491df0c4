"""The study of string stability and traffic flow: the configuration of its task."""

from dataclasses import dataclass

from rearl_jax.config import ResultsConfig
from rearl_jax.config._key import group_key, key, study_key
from rearl_jax.config._one_population import check_one_population, platoons
from rearl_jax.config._ranges import check_finite, check_least, check_positive, check_rising, check_within
from rearl_jax.config.data import DataConfig
from rearl_jax.config.driver import DEFAULT, MODELS, DriverConfig, record_of
from rearl_jax.config.evaluation import ONE_VARIANT_HELP, Variant
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class StabilityConfig:
    """Platoons, rings and queues to simulate, and their comparison with recordings"""

    models: tuple[str, ...] = key(
        tuple(MODELS), "car-following models to simulate with their usual values; `model` or `driver` replaces them"
    )
    speeds: tuple[float, ...] = key(
        (5.0, 15.0, 25.0), "speeds of the platoons [m/s]; those above the desired speed are left out"
    )
    frequencies: tuple[float, ...] = key(
        (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3),
        "frequencies of the first vehicle's speed [Hz], around those at which traffic oscillates",
    )
    amplitude: float = key(0.01, "amplitude of the first vehicle's speed [m/s]; small, because the analysis is linear")
    ring_vehicles: int = key(22, "vehicles on the rings; Sugiyama et al., New J. Phys. 10 (2008) 033001")
    ring_lengths: tuple[float, ...] = key(
        (230.0, 300.0, 400.0, 550.0), "lengths of the rings [m]; the first is that of Sugiyama et al."
    )
    ring_seconds: int = key(
        900, "simulated time on the rings [s], enough to distinguish a growth rate of 0.002/s from 0"
    )
    densities: tuple[float, ...] = key(
        (8.0, 12.0, 16.0, 20.0, 25.0, 30.0, 35.0, 40.0, 50.0, 60.0, 75.0, 90.0, 110.0),
        "densities of the fundamental diagram [vehicles/km]; those at which no vehicle can move are left out",
    )
    flow_vehicles: int = key(40, "vehicles on each ring of the fundamental diagram")
    flow_seconds: int = key(600, "simulated time on these rings [s]; the last third is measured")
    queue_vehicles: int = key(60, "vehicles that discharge from a queue on an open road")
    scenes: int = key(32, "scenes with lane changes in which collisions are counted, 30 vehicles for 60 s each")
    measured: bool = key(True, "compare with the recordings of `data`")
    seconds: int = key(60, "length of the uninterrupted recordings behind one leader that are compared [s]")
    margin: float = key(0.2, "largest relative difference in amplification that counts as equivalent [-]")
    seed: int = key(0, "seed of drivers and perturbations")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range, and for an unknown model."""
        if not self.models or len(set(self.models)) != len(self.models):
            raise out_of_range("models", "must name each model once, and at least one", list(self.models))
        for name in self.models:
            if name not in MODELS:
                raise out_of_range("models", f"must be some of {', '.join(MODELS)}", name)
        check_rising(self, "speeds", "ring_lengths", "densities")
        check_positive(self, "amplitude", "margin")
        check_finite(self, "speeds", "ring_lengths", "densities", "amplitude", "margin")
        check_least(self, 3, "ring_vehicles", "flow_vehicles")
        check_least(self, 30, "queue_vehicles")
        check_least(self, 300, "ring_seconds", "flow_seconds")
        check_least(self, 1, "scenes")
        check_least(self, 20, "seconds")
        check_within(self, 0, 2**31 - 4, "seed")
        if not self.frequencies or not all(0 < value <= 1 for value in self.frequencies):
            raise out_of_range("frequencies", "must be within 0 and 1 Hz, and at least one", list(self.frequencies))


@dataclass(unsafe_hash=True)
class StudyStabilityTask:
    """String stability, flow and collisions of simulated traffic."""

    study: str = study_key("study_stability")
    model: str | None = key(
        None, "repaired model, a model.yaml written by `rearl discover`; null = `driver` or stability.models"
    )
    variant: Variant = key(Variant.repaired, ONE_VARIANT_HELP)
    results: ResultsConfig = group_key(ResultsConfig)
    data: DataConfig = key(platoons, "Recordings whose followers are compared")
    driver: DriverConfig = key(
        record_of(DEFAULT), "Car following, sizes and classes of the drivers; if given, the only model"
    )
    stability: StabilityConfig = group_key(StabilityConfig)

    def check(self) -> None:
        """Raise InvalidInputError for drivers given by both model and driver, and for variant=all."""
        check_one_population(self.variant, self.model, "a study has one", has_drivers=not self.driver.is_default)

"""The traffic models of a study of stability, and their drivers for each measurement."""

from dataclasses import dataclass, fields, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.config.driver import DriverConfig, record_of
from rearl_jax.config.evaluation import Variant
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.config.stability import StudyStabilityTask
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.car_following.model import CarFollowing, Linearisation, linearise
from rearl_jax.core.effects.perception import ReactionDelay
from rearl_jax.export.platoon import STEPS_PER_SECOND
from rearl_jax.models.file import read_model
from rearl_jax.models.population import Population, population_of_keys, population_of_model
from rearl_jax.study.stability.analysis import Scheme

DRAWN = {"desired_speed": 30.0, "accel_exponent": 4.0}
"""Values of parameters that highway-env draws with the initial state: the middle of its range."""

NEAR_DESIRED = 0.98
"""Share of the desired speed up to which an equilibrium behind a leader is sought [-]."""


@dataclass(frozen=True)
class Case:
    """One traffic model.

    Attributes:
        name: Name in tables and folders.
        population: Its drivers, with effects and noise.
    """

    name: str
    population: Population

    @property
    def typical(self) -> Population:
        """The same drivers without differences and chance: medians of the first class, no random numbers."""
        own = self.population
        return replace(
            own,
            shares=own.shares[:0],
            median=own.median[:1],
            factor=np.zeros_like(own.factor[:1]),
            noise=np.zeros_like(own.noise[:1]),
            length=own.length[:1] * np.array([1.0, 0.0], own.length.dtype),
            is_truck=own.is_truck[:1],
            effects=tuple(effect for effect in own.effects if "seed" not in {item.name for item in fields(effect)}),
            is_noisy=False,
        )

    @property
    def driver(self) -> CarFollowing:
        """Car following of the typical driver."""
        return CAR_FOLLOWING[self.population.car_following].of_rows(jnp.asarray(self.population.median[0]))

    @property
    def length(self) -> float:
        """Length of the typical vehicle [m]."""
        return float(self.population.length[0, 0])

    @property
    def desired_speed(self) -> float:
        """Desired speed of the typical driver [m/s]."""
        return float(self.driver.desired_speed)

    @property
    def scheme(self) -> Scheme:
        """Time step, and delays if the model has any."""
        for effect in self.population.effects:
            if isinstance(effect, ReactionDelay):
                return Scheme(1 / STEPS_PER_SECOND, float(effect.delay.mean()), float(effect.own_delay.mean()))
        return Scheme(1 / STEPS_PER_SECOND)

    @property
    def beyond_analysis(self) -> tuple[str, ...]:
        """Effects of the typical driver that the analysis leaves out."""
        return tuple(effect.name for effect in self.typical.effects if not isinstance(effect, ReactionDelay))

    def slopes(self, speed: float) -> Linearisation:
        """Slopes of the typical driver's acceleration at the equilibrium at a speed [m/s]."""
        return linearise(self.driver, jnp.asarray(speed, self.population.median.dtype))

    def equilibrium_gaps(self, speed: Float[np.ndarray, " speeds"]) -> Float[np.ndarray, " speeds"]:
        """Gaps of the typical driver at equilibrium [m]."""
        return np.asarray(self.driver.equilibrium_gap(jnp.asarray(speed, self.population.median.dtype)))

    @property
    def standing_spacing(self) -> float:
        """Distance between the centres of vehicles that stand at equilibrium [m]."""
        return self.length + float(self.equilibrium_gaps(np.zeros(1))[0])

    def speed_at(self, gap: float) -> float:
        """Speed of the typical driver at equilibrium at a gap [m/s]; at most NEAR_DESIRED of the desired speed."""
        speeds = np.linspace(0.0, NEAR_DESIRED * self.desired_speed, 4001)
        return float(np.interp(gap, self.equilibrium_gaps(speeds), speeds))


def cases_of(config: StudyStabilityTask) -> list[Case]:
    """The traffic models of a study: a repaired one, that of `driver`, or all of `stability.models`.

    Raises:
        MissingInputError, BadModelError: There is no such model, or it cannot be read.
    """
    dtype = np.dtype(np.float64)
    if config.model is not None:
        repaired = config.variant is Variant.repaired
        model = read_model(config.model)
        own = population_of_model(model, dtype, with_effects=repaired, ticks_per_second=STEPS_PER_SECOND)
        return [Case(config.variant.name, own)]
    drivers = [record_of(name)() for name in config.stability.models]
    if not config.driver.is_default:
        drivers = [config.driver]
    return [Case(driver.model, _population(driver, dtype)) for driver in drivers]


def _population(driver: DriverConfig, dtype: np.dtype) -> Population:
    drawn = {name: value for name, value in DRAWN.items() if getattr(driver, name, value) is None}
    population = population_of_keys(replace(driver, **drawn), MobilConfig(), dtype, STEPS_PER_SECOND)
    assert population is not None  # only for highway-env's drivers with drawn desired speeds
    return population

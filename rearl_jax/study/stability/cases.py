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

TYPICAL_DRAWN = {"desired_speed": 30.0, "accel_exponent": 4.0}
"""Typical values of parameters that highway-env draws with the initial state: the middle of the drawn range."""

MAX_SPEED_SHARE = 0.98
"""Largest speed of an equilibrium behind a leader, as a share of the desired speed [-]."""


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
        """The typical driver: medians of the first class, without random effects and noise."""
        drivers = self.population
        return replace(
            drivers,
            shares=drivers.shares[:0],
            median=drivers.median[:1],
            factor=np.zeros_like(drivers.factor[:1]),
            noise=np.zeros_like(drivers.noise[:1]),
            length=drivers.length[:1] * np.array([1.0, 0.0], drivers.length.dtype),
            is_truck=drivers.is_truck[:1],
            effects=tuple(effect for effect in drivers.effects if "seed" not in {item.name for item in fields(effect)}),
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
        """Speed of the typical driver at equilibrium at a gap [m/s]; at most MAX_SPEED_SHARE of the desired speed."""
        speeds = np.linspace(0.0, MAX_SPEED_SHARE * self.desired_speed, 4001)
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
        population = population_of_model(model, dtype, with_effects=repaired, ticks_per_second=STEPS_PER_SECOND)
        return [Case(config.variant.name, population)]
    drivers = [record_of(name)() for name in config.stability.models]
    if not config.driver.is_default:
        drivers = [config.driver]
    return [Case(driver.model, _population(driver, dtype)) for driver in drivers]


def _population(driver: DriverConfig, dtype: np.dtype) -> Population:
    """Drivers of keys, with the typical value of every parameter that highway-env would draw."""
    missing = {name: value for name, value in TYPICAL_DRAWN.items() if getattr(driver, name, value) is None}
    population = population_of_keys(replace(driver, **missing), MobilConfig(), dtype, STEPS_PER_SECOND)
    assert population is not None  # None only where desired speeds are drawn
    return population

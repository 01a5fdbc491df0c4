"""Drivers drawn from a population (a distribution of driver parameters), as columns of numbers for every target."""

from collections.abc import Mapping
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Key

from rearl_jax.config.driver import MODELS
from rearl_jax.core.drivers import Drivers, highway_env_drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import TrafficState, make_state
from rearl_jax.models.population import Population
from rearl_jax.models.traffic import DrawnDrivers, draw_drivers, populate

DRAWING_SPACING = 100.0
"""Distance between vehicles while their drivers are drawn [m]; no simulation starts from these positions."""


@dataclass(frozen=True)
class DriverColumns:
    """Some drivers of one population.

    Attributes:
        car_following: Name of their car-following model.
        values: Value of each parameter of the model for each driver, nan where highway-env draws it with the initial
            state; parameters that it draws for all drivers are left out.
        length: Lengths of the vehicles [m].
        is_truck: Whether each is a truck.
    """

    car_following: str
    values: Mapping[str, Float[np.ndarray, " drivers"]]
    length: Float[np.ndarray, " drivers"]
    is_truck: Bool[np.ndarray, " drivers"]

    def __len__(self) -> int:
        return len(self.length)


def draw(population: Population, n: int, seed: int) -> DriverColumns:
    """`n` drivers drawn independently, as a simulation of the population draws them, with the correlations of their
    parameters.
    """
    drawn = _draw(jax.random.split(jax.random.key(seed), 1), n, population)
    names = [name for name in MODELS[population.car_following].names if name not in population.drawn]
    values = {name: np.asarray(drawn.values[name])[:, 0] for name in names}
    return DriverColumns(
        population.car_following, values, np.asarray(drawn.length)[:, 0], np.asarray(drawn.is_truck)[:, 0]
    )


@eqx.filter_jit
def _draw(keys: Key[Array, " scenarios"], n: int, population: Population) -> DrawnDrivers:
    """`n` drivers of a population for each key."""
    return draw_drivers(keys, n, population.median.dtype, population)


def place_vehicles(
    population: Population, speed: Float[np.ndarray, "vehicles scenarios"], road: TrafficModel, seed: int
) -> tuple[TrafficState, Drivers]:
    """Vehicles on one lane at these speeds [m/s], with drivers drawn from the population, the foremost first."""
    n_vehicles, n_scenarios = speed.shape
    dtype = population.median.dtype
    x = np.broadcast_to(DRAWING_SPACING * np.arange(n_vehicles, 0, -1)[:, None], speed.shape)
    start = make_state(x, np.zeros_like(x), speed, road, dtype=dtype.type)
    keys = jax.random.split(jax.random.key(seed), n_scenarios)
    default_drivers = highway_env_drivers(dtype=dtype, ticks_per_second=road.ticks_per_second)
    return _populate(start, default_drivers, keys, population, road)


_populate = eqx.filter_jit(populate)


def driver_columns(population: Population, drivers: Drivers, n: int, scenario: int) -> DriverColumns:
    """The `n` drivers of one scenario as columns, from arrays `[vehicles, scenarios]`."""

    def column(values: object) -> np.ndarray:
        by_scenario = np.asarray(values)  # a last axis of length 1 means the same for all scenarios
        return np.broadcast_to(by_scenario[:, min(scenario, by_scenario.shape[1] - 1)], (n,))

    names = [name for name in MODELS[population.car_following].names if name not in population.drawn]
    return DriverColumns(
        population.car_following,
        {name: column(getattr(drivers.car_following, name)) for name in names},
        column(drivers.body.length),
        column(drivers.body.is_truck),
    )

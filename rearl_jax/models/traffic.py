"""Traffic of a population of drivers with its effects.

The quantiles of a driver's parameters depend only on the random key of the scenario. So a scenario has the same
quantiles with and without effects, and for all values of the configuration keys (common random numbers).
"""

from dataclasses import fields, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int, Key

from rearl_jax.config.driver import DEFAULT, MODELS
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.drivers import Body, Drivers
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.noise import AccelerationNoise
from rearl_jax.core.following import HARDEST_BRAKING
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import inverse, take_vehicles
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.spawn import ticks_to_first_decision
from rearl_jax.core.state import TrafficState, nearest_lane
from rearl_jax.models.population import LaneChanging, Population

POPULATION_STREAM = 3
"""Random stream of the drivers, separate from that of the initial state."""

SEED_STREAM = 100
"""First of the streams of the effects' random numbers, one for each effect."""

TRUNCATION = 2.5
"""Standard deviations at which a driver's parameters and a vehicle's length are truncated."""

MIN_GAP = 4.0
"""Gap [m] between vehicles that would otherwise start inside or close behind each other: the smallest gap between two
cars on one lane that highway-env spawns.
"""


def populate(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    population: Population,
    model: TrafficModel,
    replayed: ReplayedVehicles | None = None,
    highest_speed: Float[Array, "vehicles scenarios"] | None = None,
) -> tuple[TrafficState, Drivers]:
    """The given vehicles at their positions and speeds, with lengths and drivers drawn from the population.

    Vehicles that would start inside each other are moved forward, unless they were recorded.

    Args:
        state: Initial state.
        drivers: Drivers of the traffic, whose lane-changing parameters are kept if the population has none.
        keys: One random key per scenario.
        population: Population of the drivers.
        model: Traffic model; only its road is used.
        replayed: Recorded vehicles around them; None for none.
        highest_speed: Highest speed of each vehicle, if they were recorded, as in `begin_driving`; else None.
    """
    drawn = draw_drivers(keys, state.x.shape[0], state.x.dtype, population)
    values = {name: _with_drawn(name, value, state, drivers) for name, value in drawn.values.items()}
    values |= {name: getattr(drivers.car_following, name) for name in population.drawn}
    effects = _seeded(population.effects, keys)
    if population.is_noisy:
        effects = (*effects, AccelerationNoise(drawn.noise[0], drawn.noise[1], _seeds(keys, SEED_STREAM)))
    # highway-env's drivers brake and accelerate within highway-env's bounds, all others within what a vehicle can do.
    is_default = population.car_following == DEFAULT
    limit = drivers.body.accel_limit if is_default else jnp.full_like(drivers.body.accel_limit, -HARDEST_BRAKING)
    drivers = replace(
        drivers,
        car_following=CAR_FOLLOWING[population.car_following](**values),
        body=Body(drawn.length, drivers.body.width, limit, drivers.body.collides, drawn.is_truck),
        effects=effects,
    )
    if highest_speed is None and (population.is_resized or not is_default):
        state = replace(state, x=make_room(state, drawn.length, model))
    if population.lane_changing is not None:
        state, drivers = _with_lane_changing(state, drivers, population.lane_changing, model)
    return begin_driving(state, drivers, model, replayed, highest_speed), drivers


class DrawnDrivers(NamedTuple):
    """Drivers drawn from a population.

    Attributes:
        values: Values of the parameters of their car-following model by name, within their bounds; nan for parameters
            drawn with the initial state instead.
        noise: Standard deviation [m/s^2] and correlation time [s] of the acceleration noise.
        length: Lengths of the vehicles [m].
        is_truck: Whether each vehicle is a truck.
    """

    values: dict[str, Float[Array, "vehicles scenarios"]]
    noise: Float[Array, "sd_and_time vehicles scenarios"]
    length: Float[Array, "vehicles scenarios"]
    is_truck: Bool[Array, "vehicles scenarios"]


def draw_drivers(
    keys: Key[Array, " scenarios"], n_vehicles: int, dtype: jnp.dtype, population: Population
) -> DrawnDrivers:
    """Drivers of each scenario, which do not depend on the other scenarios.

    Args:
        keys: One random key per scenario.
        n_vehicles: Vehicles per scenario.
        dtype: Floating type.
        population: Population of the drivers.
    """
    names = MODELS[population.car_following].names

    def draw(key: Key[Array, ""]) -> tuple[Array, Array, Array]:
        class_key, parameter_key, length_key = jax.random.split(jax.random.fold_in(key, POPULATION_STREAM), 3)
        deviates = jax.random.normal(parameter_key, (len(names), n_vehicles), dtype)
        uniform = jax.random.uniform(class_key, (n_vehicles,), dtype)
        return uniform, deviates, jax.random.normal(length_key, (n_vehicles,), dtype)

    uniform, parameter_deviates, length_deviates = jax.vmap(draw, out_axes=-1)(keys)
    driver_class = class_numbers(uniform, jnp.asarray(population.shares))
    parameter_deviates, length_deviates = (
        jnp.clip(deviates, -TRUNCATION, TRUNCATION) for deviates in (parameter_deviates, length_deviates)
    )
    tables = jax.tree.map(jnp.asarray, (population.median, population.factor, population.noise, population.length))
    median, factor, noise, length = (jnp.moveaxis(table[driver_class], (0, 1), (-2, -1)) for table in tables)
    values = dict(zip(names, median * jnp.exp(jnp.sum(factor * parameter_deviates[None], axis=1)), strict=True))
    return DrawnDrivers(
        values=_within_bounds(values, population),
        noise=noise,
        length=jnp.maximum(length[0] + length[1] * length_deviates, 1.0),
        is_truck=jnp.asarray(population.is_truck)[driver_class],
    )


def _within_bounds(values: dict[str, Array], population: Population) -> dict[str, Array]:
    """Parameters by name, within the bounds that their model declares."""
    declared = {parameter.name: parameter for parameter in MODELS[population.car_following].parameters}
    return {name: jnp.clip(value, declared[name].low, declared[name].high) for name, value in values.items()}


def _with_drawn(name: str, value: Array, state: TrafficState, drivers: Drivers) -> Array:
    """A parameter, with the value drawn with the initial state for classes of drivers that leave it open (nan)."""
    drawn = state.desired_speed if name == "desired_speed" else getattr(drivers.car_following, name, None)
    return value if drawn is None else jnp.where(jnp.isnan(value), drawn, value)


def class_numbers(
    uniform: Float[Array, "vehicles scenarios"], shares: Float[Array, " others"]
) -> Int[Array, "vehicles scenarios"]:
    """Class of each vehicle: the first unless another one is drawn.

    Args:
        uniform: Number drawn from U(0, 1).
        shares: Shares of all classes but the first [-].
    """
    passed = jnp.sum(uniform[None] >= jnp.cumsum(shares)[:, None, None], axis=0, dtype=jnp.int32)
    return jnp.where(passed == len(shares), 0, passed + 1)


def _with_lane_changing(
    state: TrafficState, drivers: Drivers, lane_changing: LaneChanging, model: TrafficModel
) -> tuple[TrafficState, Drivers]:
    """Traffic whose drivers change lanes with these MOBIL parameters, and their times of the first decision."""
    numbers = {name: getattr(lane_changing, name) for name in ("politeness", "gain_threshold", "safe_decel")}
    mobil = replace(
        drivers.mobil,
        **{name: jnp.broadcast_to(value, drivers.mobil.politeness.shape) for name, value in numbers.items()},
        decision_period=jnp.broadcast_to(lane_changing.period, drivers.mobil.decision_period.shape),
    )
    delay, period = (jnp.broadcast_to(value, state.x.shape) for value in (lane_changing.delay, lane_changing.period))
    ticks = ticks_to_first_decision(state.x, state.y, delay, period, model.ticks_per_second)
    return replace(state, ticks_to_decision=ticks), replace(drivers, mobil=mobil)


def _seeds(keys: Key[Array, " scenarios"], stream: int) -> Array:
    """A seed per scenario."""
    draw = jax.vmap(lambda key: jax.random.randint(jax.random.fold_in(key, stream), (), 0, 2**31 - 1, jnp.int32))
    return draw(keys)[None]


def _seeded(effects: tuple[Effect, ...], keys: Key[Array, " scenarios"]) -> tuple[Effect, ...]:
    """Effects with random numbers of their own in every scenario."""
    return tuple(
        replace(effect, seed=_seeds(keys, SEED_STREAM + 1 + index))  # type: ignore[call-arg] # only those that have one
        if "seed" in {item.name for item in fields(effect)}
        else effect
        for index, effect in enumerate(effects)
    )


def make_room(
    state: TrafficState, length: Float[Array, "vehicles scenarios"], model: TrafficModel
) -> Float[Array, "vehicles scenarios"]:
    """Positions [m] at which no vehicle starts inside or close behind another on its lane; most are unchanged.

    Args:
        state: The vehicles.
        length: Lengths of the vehicles [m].
        model: Traffic model; only its road is used.
    """
    order = jnp.argsort(state.x, axis=0).astype(jnp.int32)
    lane = nearest_lane(state.y, model)

    def place_vehicle(
        fronts: tuple[Array, ...], vehicle: tuple[Array, Array, Array]
    ) -> tuple[tuple[Array, ...], Array]:
        x, vehicle_length, vehicle_lane = vehicle
        for lane_number, front in enumerate(fronts):
            x = jnp.where(vehicle_lane == lane_number, jnp.maximum(x, front + MIN_GAP + vehicle_length / 2), x)
        vehicle_front = x + vehicle_length / 2
        return tuple(
            jnp.where(vehicle_lane == lane_number, vehicle_front, front) for lane_number, front in enumerate(fronts)
        ), x

    no_vehicle = jnp.full(state.x.shape[1:], -jnp.inf, state.x.dtype)
    vehicles = take_vehicles(state.x, order), take_vehicles(length, order), take_vehicles(lane, order)
    _, x = lax.scan(place_vehicle, (no_vehicle,) * model.n_lanes, vehicles)
    return take_vehicles(x, inverse(order))

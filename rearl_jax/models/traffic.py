"""Traffic that drives by a repaired model: drivers drawn from its population, and its effects.

What a driver is drawn with depends on the scenario's key alone, so that the same scenario has the same quantiles of
drivers with and without effects (common random numbers).
"""

from dataclasses import fields, replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Key

from rearl_jax.core.drivers import Body, Drivers
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.noise import AccelerationNoise
from rearl_jax.core.following import HARDEST_BRAKING
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.gap_idm import FollowingParams
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import inverse, pick
from rearl_jax.core.state import TrafficState, nearest_lane
from rearl_jax.models.record import CAR, PARAMETERS, TRUCK, DriverClass, EffectValues, RepairedModel

POPULATION_STREAM = 3
"""Separates the random numbers of the drivers from those of the initial state."""

SEED_STREAM = 100
"""The same of the effects' random numbers; one stream for each effect."""

FURTHEST = 2.5
"""Standard deviations at which a driver's parameters and a vehicle's length are cut; own choice."""

LEAST_GAP = 4.0
"""Gap [m] that is left between vehicles which would start inside or close behind each other; own choice, what
highway-env's spawning leaves at least between two of its cars on one lane.
"""


class TrafficNumbers(eqx.Module):
    """A population and its effects as arrays, cars first, trucks second.

    Attributes:
        truck_share: Of all vehicles [-].
        mean: Of the logarithms of the drivers' parameters.
        factor: Lower triangular factor of their covariance.
        noise: Standard deviation [m/s^2] and correlation time [s] of the acceleration's noise.
        length: Mean and standard deviation of the length [m].
        effects: What acts on the drivers beyond car following.
        is_noisy: Whether there is any noise.
    """

    truck_share: Float[Array | np.ndarray, ""]
    mean: Float[Array | np.ndarray, "classes parameters"]
    factor: Float[Array | np.ndarray, "classes parameters parameters"]
    noise: Float[Array | np.ndarray, "classes two"]
    length: Float[Array | np.ndarray, "classes two"]
    effects: tuple[Effect, ...]
    is_noisy: bool = eqx.field(static=True)


def traffic_numbers(model: RepairedModel, dtype: np.dtype, *, with_effects: bool) -> TrafficNumbers:
    """The repaired model as arrays, or the one that was calibrated without effects.

    Args:
        model: The model.
        dtype: Floating type of the simulation.
        with_effects: Whether to take the drivers calibrated with the effects, and the effects.
    """
    classes = model.population if with_effects else model.baseline
    both = [classes[CAR], classes.get(TRUCK, classes[CAR])]
    share = classes[TRUCK].share if TRUCK in classes else 0.0

    def table(*columns: str) -> np.ndarray:
        return np.array([[getattr(drivers, name) for name in columns] for drivers in both], dtype)

    return TrafficNumbers(
        truck_share=np.array(share, dtype),
        mean=np.array([[drivers.log_mean[name] for name in PARAMETERS] for drivers in both], dtype),
        factor=np.stack([_factor(drivers) for drivers in both]).astype(dtype),
        noise=table("noise_sd", "noise_time"),
        length=table("length", "length_sd"),
        effects=tuple(effect_of(values, dtype) for values in model.effects) if with_effects else (),
        is_noisy=any(drivers.noise_sd > 0 for drivers in classes.values()),
    )


def effect_of(values: EffectValues, dtype: np.dtype) -> Effect:
    """The effect of a model file, for traffic with one scenario axis."""
    numbers: dict[str, Any] = {name: jnp.asarray(value, dtype) for name, value in values.parameters.items()}
    if values.variable is not None:
        numbers |= {"values": numbers["values"][:, None, None], "variable": values.variable}
    return EFFECTS[values.name](**numbers)


def _factor(drivers: DriverClass) -> np.ndarray:
    """Lower triangular L with L L' the covariance, which need not have full rank."""
    values, vectors = np.linalg.eigh(np.array(drivers.log_covariance))
    _, upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0.0))).T)
    return (upper * np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]).T


def populate(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    numbers: TrafficNumbers,
    model: TrafficModel,
) -> tuple[TrafficState, Drivers]:
    """The same vehicles at the same places with the same speeds, but of the model's lengths and driven by its drivers.

    Vehicles that would start inside each other are moved forward.

    Args:
        state: Initial state.
        drivers: Its drivers, whose rules of lane changing stay.
        keys: One random key per scenario.
        numbers: The model.
        model: The road.
    """
    n_vehicles, dtype = state.x.shape[0], state.x.dtype

    def draw(key: Key[Array, ""]) -> tuple[Array, Array, Array]:
        class_key, own_key, length_key = jax.random.split(jax.random.fold_in(key, POPULATION_STREAM), 3)
        own = jax.random.normal(own_key, (len(PARAMETERS), n_vehicles), dtype)
        place = jax.random.uniform(class_key, (n_vehicles,), dtype)
        return place, own, jax.random.normal(length_key, (n_vehicles,), dtype)

    place, own, long = jax.vmap(draw, out_axes=-1)(keys)
    number = (place < numbers.truck_share).astype(jnp.int32)
    own, long = jnp.clip(own, -FURTHEST, FURTHEST), jnp.clip(long, -FURTHEST, FURTHEST)
    tables = jax.tree.map(jnp.asarray, (numbers.mean, numbers.factor, numbers.noise, numbers.length))
    mean, factor, noise, length = (jnp.moveaxis(table[number], (0, 1), (-2, -1)) for table in tables)
    logarithms = mean + jnp.sum(factor * own[None], axis=1)
    following = FollowingParams(*jnp.exp(logarithms))
    lengths = jnp.maximum(length[0] + length[1] * long, 1.0)
    effects = _seeded(numbers.effects, keys)
    if numbers.is_noisy:
        effects = (*effects, AccelerationNoise(noise[0], noise[1], _seeds(keys, SEED_STREAM)))
    drivers = replace(
        drivers,
        idm=_as_in_highway_env(drivers, following, lengths),
        body=Body(lengths, drivers.body.width, drivers.body.collides, number == 1),
        following=following,
        effects=effects,
    )
    return begin_driving(replace(state, x=make_room(state, lengths, model)), drivers, model), drivers


def _as_in_highway_env(drivers: Drivers, following: FollowingParams, length: Float[Array, "vehicles scenarios"]):
    """The same drivers in highway-env's form, for the rules that ask for a spacing from centre to centre."""
    return replace(
        drivers.idm,
        max_accel=following.max_accel,
        comfort_decel=following.comfort_decel,
        jam_spacing=following.jam_gap + length,
        time_gap=following.time_gap,
        accel_exponent=jnp.full_like(length, 4.0),
        accel_limit=jnp.full_like(length, -HARDEST_BRAKING),
    )


def _seeds(keys: Key[Array, " scenarios"], stream: int) -> Array:
    """A seed per scenario."""
    draw = jax.vmap(lambda key: jax.random.randint(jax.random.fold_in(key, stream), (), 0, 2**31 - 1, jnp.int32))
    return draw(keys)[None]


def _seeded(effects: tuple[Effect, ...], keys: Key[Array, " scenarios"]) -> tuple[Effect, ...]:
    """Effects with random numbers of their own in every scenario."""
    return tuple(
        replace(effect, seed=_seeds(keys, SEED_STREAM + 1 + place))  # type: ignore[call-arg] # only those that have one
        if "seed" in {item.name for item in fields(effect)}
        else effect
        for place, effect in enumerate(effects)
    )


def make_room(
    state: TrafficState, length: Float[Array, "vehicles scenarios"], model: TrafficModel
) -> Float[Array, "vehicles scenarios"]:
    """Positions [m] at which nobody starts inside or close behind another on its lane; most stay where they are.

    Args:
        state: The vehicles.
        length: Their lengths [m].
        model: The road.
    """
    order = jnp.argsort(state.x, axis=0).astype(jnp.int32)
    lane = nearest_lane(state.y, model)

    def place(fronts: tuple[Array, ...], vehicle: tuple[Array, Array, Array]) -> tuple[tuple[Array, ...], Array]:
        x, its_length, its_lane = vehicle
        for number, front in enumerate(fronts):
            x = jnp.where(its_lane == number, jnp.maximum(x, front + LEAST_GAP + its_length / 2), x)
        ends = x + its_length / 2
        return tuple(jnp.where(its_lane == number, ends, front) for number, front in enumerate(fronts)), x

    nobody = jnp.full(state.x.shape[1:], -jnp.inf, state.x.dtype)
    vehicles = pick(state.x, order), pick(length, order), pick(lane, order)
    _, x = lax.scan(place, (nobody,) * model.n_lanes, vehicles)
    return pick(x, inverse(order))

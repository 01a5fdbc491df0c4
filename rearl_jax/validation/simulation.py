"""The core on scenes that highway-env has run: the same vehicles, the same meta-actions, every tick recorded."""

import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.car_following.highway_env_idm import VEHICLE_LENGTH, HighwayEnvIDM
from rearl_jax.core.drivers import Body, Drivers, MOBILParams
from rearl_jax.core.meta_actions import apply_meta_actions
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, TrafficState, make_state, nearest_lane
from rearl_jax.core.step import step
from rearl_jax.core.timer import decision_period
from rearl_jax.validation.records import Recorded, Start, Tracks, stack
from rearl_jax.validation.scenarios import ScenarioSet

VECTOR_WIDTH = 8
"""The number of scenarios of a device is a multiple of this. XLA runs a rest that does not fill a vector through scalar
code, whose last place may differ; eight doubles fill the widest vectors."""


def batch_size(n_vehicles: int) -> int:
    """Scenes of `n_vehicles` vehicles that are simulated at once.

    Every batch of a set is filled up to this size, so that one program serves all.
    """
    return jax.local_device_count() * VECTOR_WIDTH * max(1, min(4, 40 // n_vehicles))


def model_of(scenario_set: ScenarioSet) -> TrafficModel:
    """The core's road and stages for a set."""
    return TrafficModel(speed_levels=scenario_set.speed_levels, cooperative=scenario_set.cooperative)


def simulate(scenes: Sequence[Recorded], model: TrafficModel, dtype: type) -> Tracks:
    """The tracks of the core, as many ticks as were recorded, the start included, the scenario axis last.

    Args:
        scenes: Scenes of equal size, at most `batch_size`.
        model: Traffic model; only its road is used.
        dtype: np.float32 or np.float64; the latter needs JAX's x64 mode.

    Raises:
        ValueError: If a result is not finite.
    """
    size = batch_size(scenes[0].tracks.x.shape[1])
    recorded = stack([*scenes, *(scenes[-1],) * (size - len(scenes))])
    state = initial_state(recorded.start, model, dtype)
    drivers = _drivers(recorded.start, model, dtype)
    arguments = jax.tree.map(np.asarray, (state, drivers, recorded.actions.astype(np.int32)))
    after_ticks = _program(model, size)(arguments)
    at_start = jax.tree.map(np.asarray, _observe(state, model))
    columns = [
        np.concatenate([start[None], ticks])[..., : len(scenes)]
        for start, ticks in zip(at_start, after_ticks, strict=True)
    ]
    for name, values in zip(("x", "y", "heading", "speed"), columns, strict=False):  # the first four columns
        if not np.isfinite(values).all():
            raise ValueError(f"the core's {name} is not finite in {np.dtype(dtype).name}: a fault of the core")
    return Tracks(*columns)


@functools.cache
def _program(model: TrafficModel, size: int) -> ScenarioMap:
    """Compiled for the model: from (state, drivers, actions) to the result of `_observe` after every tick."""

    def run(arguments: tuple[TrafficState, Drivers, jax.Array]) -> tuple[jax.Array, ...]:
        state, drivers, actions = arguments

        def next_tick(before: TrafficState, _: None) -> tuple[TrafficState, tuple[jax.Array, ...]]:
            after = step(before, drivers, model)
            return after, _observe(after, model)

        def next_second(before: TrafficState, action: jax.Array) -> tuple[TrafficState, tuple[jax.Array, ...]]:
            decided = apply_meta_actions(before, action, model)
            return lax.scan(next_tick, decided, length=model.ticks_per_second)

        _, frames = lax.scan(next_second, state, actions)
        return jax.tree.map(lambda values: values.reshape(-1, *values.shape[2:]), frames)

    return ScenarioMap(run, chunk=size // jax.local_device_count())


def _observe(state: TrafficState, model: TrafficModel) -> tuple[jax.Array, ...]:
    """The fields of `Tracks`."""
    lane = nearest_lane(state.y, model)
    return state.x, state.y, state.heading, state.speed, lane, state.target_lane, state.crashed


def initial_state(start: Start, model: TrafficModel, dtype: type) -> TrafficState:
    """The vehicles of highway-env at the beginning of a scene, as the core has them."""
    return make_state(
        start.x,
        start.y,
        start.speed,
        model,
        heading=start.heading,
        desired_speed=start.desired_speed,
        target_lane=start.target_lane,
        timer=start.timer,
        controller=np.where(start.is_meta, Controller.META, Controller.IDM),
        dtype=dtype,
    )


def _drivers(start: Start, model: TrafficModel, dtype: type) -> Drivers:
    """Parameters as arrays of full size.

    XLA turns the division by a constant, or by a number broadcast to an array, into a multiplication by its inverse.
    That is faster but one unit in the last place off, which a comparison with highway-env would show.
    """

    def numbers(name: str) -> jax.Array:
        return jnp.asarray(getattr(start, name), dtype)

    period = jnp.full(start.x.shape, decision_period(1.0, model.ticks_per_second), jnp.int32)
    return Drivers(
        car_following=HighwayEnvIDM(
            desired_speed=None,
            time_gap=numbers("time_gap"),
            jam_gap=numbers("jam_spacing") - VEHICLE_LENGTH,
            max_accel=numbers("max_accel"),
            comfort_decel=numbers("comfort_decel"),
            accel_exponent=numbers("accel_exponent"),
        ),
        mobil=MOBILParams(
            politeness=numbers("politeness"),
            gain_threshold=numbers("gain_threshold"),
            safe_decel=numbers("safe_decel"),
            decision_period=period,
            changes_lanes=jnp.asarray(start.changes_lanes),
        ),
        body=Body(
            length=numbers("length"),
            width=numbers("width"),
            accel_limit=numbers("accel_limit"),
            collides=jnp.asarray(start.collides),
        ),
    )

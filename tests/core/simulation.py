"""The core as the tests run it: one compiled tick per model, type and number of vehicles, shared by all tests."""

import functools
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from rearl_jax.core import neighbours
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following.highway_env_idm import VEHICLE_LENGTH, HighwayEnvIDM
from rearl_jax.core.drivers import Body, Drivers, MOBILParams
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, make_state
from rearl_jax.core.step import step
from tests.core import scenes

MODEL = TrafficModel()
WIDE = TrafficModel(
    n_lanes=8, lane_width=3.5, road_length=400.0, speed_limit=None, ticks_per_second=10, cooperative=True
)
NARROW = TrafficModel(n_lanes=1)
SHORT = TrafficModel(road_length=300.0)
MODEL_OF = {
    id(scenes.ROAD): MODEL,
    id(scenes.WIDE): WIDE,
    id(scenes.NARROW): NARROW,
    id(scenes.SHORT): SHORT,
}

LARGE = 26
"""Vehicles of the tests of large traffic, whose neighbours are searched along the sorted road."""

N_VEHICLES = 10
"""Vehicles of nearly all small tests: another number is another program, and compiling takes longer than any test."""

WIDTH = 256
"""Scenarios per call, filled up with copies of the last one; for the same reason."""


TOLERANCES = {
    # Rounding of one tick: a few units in the last place of x = 10 000 m; pushes are differences of such numbers, and
    # accelerations may have been the small difference of a free and an interaction term a hundred times as large.
    np.float64: {"x": 1e-11, "y": 1e-12, "heading": 1e-12, "speed": 1e-12, "acceleration": 1e-11, "push": 1e-10},
    # The same with 3e-5 m as the last place of x = 300 m.
    np.float32: {"x": 1e-4, "y": 1e-5, "heading": 1e-6, "speed": 1e-5, "acceleration": 2e-4, "push": 2e-4},
}
"""Largest difference [SI units] from the reference after one tick that starts from the same numbers."""

CLEAR = {np.float64: 1e-9, np.float32: 1e-4}
"""Distance [m] from another outcome above which a collision test must come out as in the reference."""


@functools.cache
def program(model, n_vehicles, dtype, largest_small_traffic):
    """One tick as a compiled function of state and drivers `[n_vehicles, WIDTH]`."""
    zeros = np.zeros((n_vehicles, WIDTH))
    state = make_state(zeros, zeros, zeros, model, dtype=dtype)
    drivers = default_drivers(zeros.shape, dtype)
    # That of large traffic runs a few times, that of small traffic for many ticks.
    options = QUICKLY_COMPILED if n_vehicles > N_VEHICLES else None
    with mock.patch.object(neighbours, "LARGEST_SMALL_TRAFFIC", largest_small_traffic):
        tick = jax.jit(lambda state, drivers: step(state, drivers, model), compiler_options=options)
        return tick.lower(state, drivers).compile()


def columns(tree, index):
    return jax.tree.map(lambda leaf: np.asarray(leaf)[..., index], tree)


def advance(state, drivers, model=MODEL, *, n_ticks=1, largest_small_traffic=None, every=None):
    """State after some ticks of any number of scenarios; with `every`, called with each state as NumPy arrays."""
    n_vehicles, n_scenarios = state.x.shape
    largest = neighbours.LARGEST_SMALL_TRAFFIC if largest_small_traffic is None else largest_small_traffic
    run = program(model, n_vehicles, np.dtype(state.x.dtype).type, largest)
    drivers = spread(drivers, state.x.shape)
    parts = []
    for start in range(0, n_scenarios, WIDTH):
        index = np.minimum(np.arange(start, start + WIDTH), n_scenarios - 1)
        part, fixed = columns(state, index), columns(drivers, index)
        for _ in range(n_ticks):
            part = run(part, fixed)
            if every is not None:
                assert n_scenarios <= WIDTH
                every(columns(part, np.arange(n_scenarios)))
        parts.append(columns(part, np.arange(min(WIDTH, n_scenarios - start))))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)


def history(state, drivers, model=MODEL, *, n_ticks, **options):
    """Stacked states after every tick, `[ticks, vehicles, scenarios]`."""
    states = []
    advance(state, drivers, model, n_ticks=n_ticks, every=states.append, **options)
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)


def spread(drivers, shape):
    """Drivers with every leaf at full shape."""
    return jax.tree.map(lambda leaf: np.broadcast_to(np.asarray(leaf), shape), drivers)


def default_drivers(shape, dtype=np.float64, **changes):
    """highway-env's drivers at full shape, some parameters changed by name."""
    same = {"max_accel": 3.0, "comfort_decel": 5.0, "jam_spacing": 10.0, "time_gap": 1.5, "exponent": 4.0}
    same |= {"accel_limit": 6.0, "politeness": 0.0, "gain_threshold": 0.2, "safe_decel": 2.0, "period": 16}
    same |= {"changes_lanes": True, "length": 5.0, "width": 2.0, "collides": True}
    assert set(changes) <= set(same)
    picture = {name: np.broadcast_to(value, shape) for name, value in (same | changes).items()}
    return drivers_of(picture, dtype)


def drivers_of(picture, dtype):
    """Drivers from arrays by name."""
    real = {name: jnp.asarray(values, dtype) for name, values in picture.items()}
    return Drivers(
        car_following=HighwayEnvIDM(
            desired_speed=None,
            time_gap=real["time_gap"],
            jam_gap=real["jam_spacing"] - VEHICLE_LENGTH,
            max_accel=real["max_accel"],
            comfort_decel=real["comfort_decel"],
            accel_exponent=real["exponent"],
        ),
        mobil=MOBILParams(
            politeness=real["politeness"],
            gain_threshold=real["gain_threshold"],
            safe_decel=real["safe_decel"],
            decision_period=jnp.asarray(picture["period"], jnp.int32),
            changes_lanes=jnp.asarray(picture["changes_lanes"], bool),
        ),
        body=Body(
            length=real["length"],
            width=real["width"],
            accel_limit=real["accel_limit"],
            collides=jnp.asarray(picture["collides"], bool),
        ),
    )


def state_of(picture, model, dtype, controller=None):
    """State of the core from the reference's numbers."""
    if controller is None:
        controller = np.where(picture["is_meta"], Controller.META, Controller.IDM)
    state = make_state(
        picture["x"],
        picture["y"],
        picture["speed"],
        model,
        heading=picture["heading"],
        desired_speed=picture["desired"],
        target_lane=picture["target"],
        controller=controller,
        crashed=picture["crashed"],
        dtype=dtype,
    )
    return eqx.tree_at(
        lambda s: (s.ticks_to_decision, s.is_pushed, s.push_x, s.push_y),
        state,
        (
            jnp.asarray(picture["ticks"], jnp.int32),
            jnp.asarray(picture["is_pushed"]),
            jnp.asarray(picture["push_x"], dtype),
            jnp.asarray(picture["push_y"], dtype),
        ),
    )


def pad(picture, slots, n_slots):
    """Arrays `[n_slots, ...]` with the cars in the given slots, and the controllers: ABSENT in all other slots.

    What absent vehicles hold must not matter: zeros, as a caller would leave them.
    """
    padded = {}
    for name, values in picture.items():
        padded[name] = np.zeros((n_slots, *values.shape[1:]), values.dtype)
        padded[name][slots] = values
    padded["length"] = np.where(padded["length"] == 0, 5.0, padded["length"])
    for name in ("max_accel", "comfort_decel", "time_gap", "exponent"):
        padded[name] = np.where(padded[name] == 0, 1.0, padded[name])
    controller = np.full(padded["x"].shape, int(Controller.ABSENT), np.int32)
    controller[slots] = np.where(picture["is_meta"], Controller.META, Controller.IDM)
    return padded, controller


def core_of(scenes_, road=scenes.ROAD, dtype=np.float64, *, n_slots=N_VEHICLES, slots=None):
    """State and drivers of scenes given as lists of cars, all equally long; the slots left over are ABSENT."""
    picture = scenes.stack([scenes.photograph(cars, road) for cars in scenes_])
    slots = np.arange(len(scenes_[0])) if slots is None else slots
    picture, controller = pad(picture, slots, n_slots)
    return state_of(picture, MODEL_OF[id(road)], dtype, controller), drivers_of(picture, dtype)


def assert_same_bits(one, other, names=None):
    """All arrays (or those named) of two states are equal bit for bit."""
    for name in names or vars(one):
        a, b = np.asarray(getattr(one, name)), np.asarray(getattr(other, name))
        assert a.dtype == b.dtype, name
        different = np.argwhere(~((a == b) | ((a != a) & (b != b))))
        assert not len(different), f"{name} differs at {different[:5].tolist()}, {len(different)} of {a.size}"

"""One tick, and many, against the slow reference."""

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.meta_actions import apply_meta_actions
from tests.core import scenes, simulation
from tests.core.simulation import CLEAR, LARGE, MODEL_OF, N_VEHICLES, TOLERANCES, WIDTH

KINDS = ("road", "stress", "meta", "level", "start", "end", "pile")
APART = tuple(kind for kind in KINDS if kind != "level")
MOTION = ("x", "y", "heading", "speed", "acceleration")

#: Recorded scenes: kinds, vehicles, road, scenes of each kind, ticks of each scene.
RECORDINGS = {
    "small": (KINDS, N_VEHICLES, scenes.ROAD, 14, 20),
    "small, short road": (KINDS, N_VEHICLES, scenes.SHORT, 14, 20),
    "eight lanes, polite": (KINDS[1:], N_VEHICLES, scenes.WIDE, 12, 20),
    "one lane": (("stress", "level", "start", "end"), N_VEHICLES, scenes.NARROW, 8, 20),
    "large": (APART, LARGE, scenes.ROAD, 5, 20),
    "large, short road": (APART, LARGE, scenes.SHORT, 5, 20),
    "large, side by side": (("level",), LARGE, scenes.ROAD, 100, 1),
}

#: What must have happened in them at least: decisions for another lane, aborts, first contacts.
HAPPENED = {
    "small": (100, 30, 200),
    "small, short road": (100, 30, 200),
    "eight lanes, polite": (100, 20, 150),
    "one lane": (0, 0, 80),
    "large": (80, 20, 200),
    "large, short road": (80, 20, 200),
    "large, side by side": (20, 10, 200),
}

#: Recordings of thorough tests alone.
THOROUGH = ("one lane", "large, short road")


@functools.cache
def recording(name):
    kinds, n_vehicles, road, n_scenes, n_ticks = RECORDINGS[name]
    return scenes.record(kinds, n_vehicles, road, n_scenes=n_scenes, n_ticks=n_ticks, seed=1)


def one_tick(name, dtype, **options):
    """The recording, and the core's states one tick after the recorded ones."""
    recorded = recording(name)
    model = MODEL_OF[id(recorded.road)]
    state = simulation.state_of(recorded.before, model, dtype)
    drivers = simulation.drivers_of(recorded.before, dtype)
    return recorded, simulation.advance(state, drivers, model, **options)


def assert_follows(after, wanted, dtype):
    """The core's states are the reference's, but for rounding and for contacts on the edge of another outcome."""
    tolerance = TOLERANCES[dtype]
    np.testing.assert_array_equal(after.target_lane, wanted["target"])
    np.testing.assert_array_equal(np.maximum(after.ticks_to_decision, 0), wanted["ticks"])
    for name in MOTION:
        value, other = getattr(after, name), wanted[name]
        np.testing.assert_allclose(value, other, rtol=0, atol=tolerance[name], err_msg=name)
    clear = wanted["margin"] > CLEAR[dtype]
    assert clear.mean() > (0.99 if dtype == np.float64 else 0.75)
    assert (clear & wanted["is_pushed"]).sum() > 500
    for name, other in (("crashed", wanted["crashed"]), ("is_pushed", wanted["is_pushed"])):
        assert not ((getattr(after, name) != other) & clear).any(), name
    for name in ("push_x", "push_y"):
        difference = np.where(clear & wanted["is_pushed"], getattr(after, name) - wanted[name], 0)
        assert abs(difference).max() < tolerance["push"], name


def marked(names):
    """The recordings; those with which only thorough tests compare the core are looked at there."""
    return [pytest.param(name, marks=pytest.mark.thorough if name in THOROUGH else ()) for name in names]


@pytest.mark.parametrize("name", marked(RECORDINGS))
def test_recorded_scenes_hold_what_they_are_to_show(name):
    recorded = recording(name)
    events, (changes, aborts, crashes) = recorded.events, HAPPENED[name]
    assert events.changes >= changes
    assert events.aborts >= aborts
    assert events.crashes >= crashes
    assert min(events.lefts, events.changes - events.lefts) >= 0.25 * changes


@pytest.mark.parametrize("name", marked(["small", "small, short road", "one lane", "large"]))
def test_recorded_scenes_reach_beyond_both_ends_of_the_road(name):
    recorded = recording(name)
    x, speed, length = recorded.before["x"], recorded.before["speed"], recorded.road.length
    assert speed.min() < 0 < 30 < speed.max()
    for low, high in ((-np.inf, -5), (-5, 0), (length, length + 5), (length + 5, np.inf)):
        assert ((low < x) & (x < high)).sum() > 10


@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        ("small", np.float64),
        ("small, short road", np.float32),
        pytest.param("eight lanes, polite", np.float64, marks=pytest.mark.thorough),
        pytest.param("one lane", np.float64, marks=pytest.mark.thorough),
    ],
)
def test_tick_in_small_traffic(name, dtype):
    recorded, after = one_tick(name, dtype)
    assert after.x.dtype == dtype
    assert_follows(after, recorded.after, dtype)


@pytest.mark.parametrize(
    ("name", "dtype"),
    [("large", np.float64), pytest.param("large, short road", np.float32, marks=pytest.mark.thorough)],
)
def test_tick_in_large_traffic(name, dtype):
    recorded, after = one_tick(name, dtype)
    assert_follows(after, recorded.after, dtype)


def test_tick_in_large_traffic_with_vehicles_side_by_side():
    """Of vehicles equally far ahead the last in the list is the leader, of those behind the first is the follower."""
    recorded, after = one_tick("large, side by side", np.float64)
    assert (np.diff(np.sort(recorded.before["x"], axis=0), axis=0) == 0).sum() > 1000
    assert_follows(after, recorded.after, np.float64)


def test_any_order_along_the_road_is_a_valid_start():
    recorded = recording("large")
    some = np.arange(WIDTH)
    state = simulation.columns(simulation.state_of(recorded.before, simulation.MODEL, np.float64), some)
    drivers = simulation.columns(simulation.drivers_of(recorded.before, np.float64), some)
    shuffled = np.random.default_rng(0).permuted(state.order, axis=0)
    assert (shuffled != state.order).mean() > 0.5
    other = eqx.tree_at(lambda s: s.order, state, shuffled)
    simulation.assert_same_bits(
        simulation.advance(state, drivers, n_ticks=3), simulation.advance(other, drivers, n_ticks=3)
    )


@pytest.mark.parametrize("name", ["small", "eight lanes, polite"])
def test_meta_actions(name):
    recorded = recording(name)
    before, told = recorded.commanded, recorded.told
    model = MODEL_OF[id(recorded.road)]
    state = simulation.state_of(before, model, np.float64)
    after = apply_meta_actions(state, jnp.asarray(recorded.actions, jnp.int32), model)
    moved, sped = told["target"] != before["target"], told["desired"] != before["desired"]
    assert moved.sum() > 15
    assert sped.sum() > 15
    refused = before["is_meta"] & ~moved & np.isin(recorded.actions, (0, 2))
    assert refused.sum() > 3
    assert (abs(told["target"] - told["lane"]) >= 2).any()
    np.testing.assert_array_equal(after.target_lane, told["target"])
    np.testing.assert_array_equal(after.desired_speed, told["desired"])


@pytest.mark.parametrize(
    ("road", "dtype", "tolerance"), [(scenes.ROAD, np.float64, 1e-9), (scenes.SHORT, np.float32, 1e-3)]
)
def test_many_ticks_without_correction(road, dtype, tolerance):
    """Errors do not grow in driving traffic: every lane change in the same tick, every place within the tolerance."""
    traffic, n_ticks = [], 180
    for seed in range(12):
        rng = np.random.default_rng([5, seed])
        cars = scenes.draw_cars("road", N_VEHICLES, road, rng)
        scenes.prepare(cars, road, rng)
        for car in cars:
            car.crashed, car.target = False, car.lane
        scenes.to_single(cars)
        traffic.append(cars)
    driven = [scenes.drive(cars, road, n_ticks) for cars in traffic]
    assert sum(events.crossings for _, events in driven) > 30
    wanted = {
        name: np.stack([[picture[name] for picture in pictures] for pictures, _ in driven], axis=-1)
        for name in driven[0][0][0]
    }
    assert not wanted["crashed"].any()
    state, drivers = simulation.core_of(traffic, road, dtype)
    states = simulation.history(state, drivers, MODEL_OF[id(road)], n_ticks=n_ticks)
    np.testing.assert_array_equal(states.target_lane, wanted["target"])
    for name in ("x", "y", "speed"):
        np.testing.assert_allclose(getattr(states, name), wanted[name], rtol=0, atol=tolerance, err_msg=name)

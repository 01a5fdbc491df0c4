"""Recorded vehicles around simulated ones: seen as if they were simulated, and vehicles that enter."""

from dataclasses import replace
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import idm_driving
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.boundary import Motion, enter, replayed_vehicles
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.lane_search import find_behind, traffic_beside
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import LARGEST_SMALL_TRAFFIC, derive_state, find_follower
from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.core.rollout import rollout
from rearl_jax.core.state import make_state
from rearl_jax.core.stimuli import vehicle_states
from tests.core.boundaries import nobody, replay_of, states_of

quickly_compiled = partial(jax.jit, compiler_options=QUICKLY_COMPILED)
"""`jax.jit` for programs that take far longer to compile than to run."""

MODEL = TrafficModel(n_lanes=3, collisions=False)
N_SECONDS = 4


def drivers_of(kind):
    drivers = highway_env_drivers(dtype=jnp.dtype("float64"))
    if kind == "highway_env":
        return drivers
    values = (jnp.full((1, 1), value) for value in (28.0, 1.2, 2.0, 1.5, 2.0))
    one = jnp.ones((1, 1))
    effects = (EFFECTS["leader_acceleration"](0.5 * one, 60.0 * one), EFFECTS["several_leaders"](0.3 * one, 0.5 * one))
    return replace(drivers, car_following=IDM(*values), effects=effects)


def traffic(n_vehicles, kind):
    """Vehicles that keep their lane, close behind each other, the foremost three of each scenario slow."""
    rng = np.random.default_rng(3)
    shape = (n_vehicles, 2)
    x = np.cumsum(rng.uniform(8.0, 14.0, shape), axis=0)
    lane = np.arange(n_vehicles)[:, None] % 3 + np.zeros((1, 2), int)
    speed = np.where(np.arange(n_vehicles)[:, None] < n_vehicles - 3, 22.0, 14.0) + np.zeros(shape)
    drivers = drivers_of(kind)
    state = make_state(x, 4.0 * lane, speed, MODEL, dtype=np.float64)
    return begin_driving(state, drivers, MODEL), drivers


@pytest.mark.parametrize(
    ("kind", "n_vehicles", "lane_changes"),
    [
        ("highway_env", 6, True),
        pytest.param("gaps", 6, False, marks=pytest.mark.thorough),
        pytest.param("highway_env", LARGEST_SMALL_TRAFFIC + 5, True, marks=pytest.mark.thorough),
        pytest.param("gaps", LARGEST_SMALL_TRAFFIC + 5, False, marks=pytest.mark.thorough),
    ],
)
def test_replayed_leaders_are_followed_as_simulated_ones_are(kind, n_vehicles, lane_changes):
    model = replace(MODEL, lane_changes=lane_changes)
    state, drivers = traffic(n_vehicles, kind)
    states = states_of(state, drivers, model, N_SECONDS + 1)
    leaders = slice(n_vehicles - 3, n_vehicles)
    others = slice(0, n_vehicles - 3)
    boundary = replay_of(states, leaders, model, 5.0)
    assert (np.asarray(boundary.motion.lane) == np.asarray(boundary.motion.lane[0, 0])).all()
    own = jax.tree.map(lambda leaf: leaf[others], replace(state, memory=None))
    own = replace(own, order=jnp.argsort(own.x, axis=0).astype(jnp.int32))
    own = begin_driving(own, drivers, model, boundary.at_start())

    run = quickly_compiled(lambda boundary: rollout(own, drivers, model, n_seconds=N_SECONDS, boundary=boundary)[1])
    found = run(boundary)
    for name in ("x", "y", "speed", "acceleration"):
        wanted = getattr(states, name)[1:, 0, others]
        np.testing.assert_allclose(getattr(found, name), wanted, rtol=0, atol=1e-9)
    gone = with_lanes(boundary, NOT_RECORDED)
    unhindered = run(gone)
    assert np.abs(unhindered.x - found.x).max() > 3.0  # the leaders did matter


def with_lanes(boundary, lane):
    return replace(boundary, motion=replace(boundary.motion, lane=jnp.full_like(boundary.motion.lane, lane)))


@cache
def bounded(kind):
    """The program of two seconds of traffic of six with a boundary."""
    state, drivers = traffic(6, kind)
    return quickly_compiled(lambda around: rollout(state, drivers, MODEL, n_seconds=2, boundary=around))


@pytest.mark.parametrize("kind", ["highway_env", pytest.param("gaps", marks=pytest.mark.thorough)])
def test_a_boundary_without_vehicles_is_a_free_road(kind):
    state, drivers = traffic(6, kind)
    free = quickly_compiled(lambda state: rollout(state, drivers, MODEL, n_seconds=2)[1])(state)
    for name, values in vars(bounded(kind)(nobody(3, 6, 2))[1]).items():
        np.testing.assert_array_equal(values, getattr(free, name), err_msg=name)


@pytest.mark.parametrize("dtype", ["float32", pytest.param("float64", marks=pytest.mark.thorough)])
def test_decisions_in_blocks_are_those_of_all(dtype, monkeypatch):
    rng = np.random.default_rng(4)
    n_vehicles, n_scenarios, n_places = 6, 40, 5
    x, lane = rng.uniform(0, 200, (n_vehicles, n_scenarios)), rng.integers(0, 3, (n_vehicles, n_scenarios))
    speed = rng.uniform(15, 25, x.shape)
    state = make_state(x, 4.0 * lane, speed, MODEL, desired_speed=speed + 5, dtype=np.dtype(dtype).type)
    drivers = highway_env_drivers(dtype=jnp.dtype(dtype))
    around = nobody(4, n_vehicles, n_scenarios, n_places=n_places)
    still = around.motion.x.astype(dtype)
    moving = {
        "x": still + jnp.asarray(rng.uniform(0, 300, still.shape[2:]), dtype)[None, None],
        "speed": still + 5,
        "acceleration": still,
        "lane": jnp.broadcast_to(jnp.asarray(rng.integers(0, 3, still.shape[2:]), jnp.int32)[None, None], still.shape),
    }
    parts = jax.tree.map(lambda leaf: leaf.astype(dtype) if leaf.dtype == float else leaf, around)
    around = replace(parts, motion=Motion(**moving))

    def frames():
        # Both programs round alike only when they are optimised as usual.
        return jax.jit(lambda around: rollout(state, drivers, MODEL, n_seconds=3, boundary=around)[1])(around)

    found = frames()
    monkeypatch.setattr(idm_driving, "_is_small_among_replayed", lambda derived: False)
    for name, values in vars(frames()).items():
        np.testing.assert_array_equal(getattr(found, name), values, err_msg=name)
    assert (np.asarray(found.lane[-1]) != lane).sum() > 10


def test_what_was_not_recorded_is_refused():
    state, drivers = traffic(6, "highway_env")
    with pytest.raises(ValueError, match="n_seconds = 3"):
        rollout(state, drivers, MODEL, n_seconds=3, boundary=nobody(3, 6, 2))


@pytest.mark.parametrize("kind", ["highway_env", pytest.param("gaps", marks=pytest.mark.thorough)])
def test_vehicles_enter_in_the_places_of_others_and_remember_nothing(kind):
    is_new = np.zeros((3, 6, 2), bool)
    is_new[1, 2, 1] = True
    same = np.ones(is_new.shape)
    around = nobody(
        *(3, 6, 2),
        is_new=is_new,
        x=3.0 * same,
        lane=same.astype(np.int32),
        speed=11.0 * same,
        highest_speed=17.0 * same,
        wait=0.5 * same,
    )
    after, before = bounded(kind)(around)[0], bounded(kind)(nobody(3, 6, 2))[0]
    assert (float(after.x[2, 1]), float(after.y[2, 1]), float(after.speed[2, 1])) == (3.0, 4.0, 11.0)
    assert float(after.desired_speed[2, 1]) == 17.0
    assert int(after.ticks_to_decision[2, 1]) == 1 + 8
    stays = np.ones((6, 2), bool)
    stays[2, 1] = False
    for name in ("x", "y", "speed", "desired_speed", "target_lane", "ticks_to_decision"):
        np.testing.assert_array_equal(np.asarray(getattr(after, name))[stays], np.asarray(getattr(before, name))[stays])
    if kind == "gaps":
        assert int(after.memory.n_ticks) == int(before.memory.n_ticks) == 30
        index = (2, 1)
        leader = after.memory.leader_history.leader
        assert int(leader[index]) != int(before.memory.leader_history.leader[index])
        np.testing.assert_array_equal(np.asarray(leader)[stays], np.asarray(before.memory.leader_history.leader)[stays])


@pytest.mark.slow
def test_vehicles_that_collided_are_counted_when_others_take_their_place():
    state, drivers = traffic(6, "highway_env")
    is_crashed, is_new = np.zeros((6, 2), bool), np.zeros((3, 6, 2), bool)
    is_crashed[[2, 4], 1] = is_new[0, 2:4, 1] = is_new[2, 2, 1] = True
    far = nobody(3, 6, 2, is_new=is_new, x=1e4 * np.ones(is_new.shape))
    state = replace(state, crashed=jnp.asarray(is_crashed), n_crashed_replaced=jnp.zeros((6, 2), jnp.int32))
    frames = quickly_compiled(lambda around: rollout(state, drivers, MODEL, n_seconds=2, boundary=around)[1])(far)
    expected = np.zeros((6, 2), int)
    expected[2, 1] = 1
    np.testing.assert_array_equal(frames.n_crashed_replaced, [expected, expected])
    assert not np.asarray(frames.crashed)[:, 2, 1].any()
    assert np.asarray(frames.crashed)[:, 4, 1].all()


def test_followers_and_vehicles_beside_may_be_replayed():
    state, drivers = traffic(6, "gaps")
    around = nobody(1, 6, 2)
    motion = jax.tree.map(lambda leaf: leaf[0, 0], around.motion)
    behind = jnp.stack([state.x[0] - 7.0, state.x[0] - 3.0])
    motion = replace(motion, x=behind, speed=behind * 0 + 9.0, lane=jnp.asarray([[0, 0], [1, 1]], jnp.int32))
    replayed = replayed_vehicles(motion, jax.tree.map(lambda leaf: leaf[0], around.identity))
    derived = derive_state(state, MODEL, replayed)
    follower = find_follower(state, derived, derived.lane)
    np.testing.assert_allclose(follower.distance[0], 7.0)
    np.testing.assert_allclose(follower.speed[0], 9.0)
    np.testing.assert_allclose(follower.speed_ratio[0], 1.0)
    vehicles = vehicle_states(state, derived, drivers)
    found = find_behind(state, derived, vehicles, derived.lane)
    np.testing.assert_allclose(found.distance[0], 7.0)
    np.testing.assert_array_equal(found.index[0], 6)
    slowest, count = traffic_beside(state, derived, vehicles)
    alone = traffic_beside(state, derive_state(state, MODEL), vehicles)
    np.testing.assert_allclose(slowest[0], 9.0)
    np.testing.assert_allclose(count[0], alone[1][0] + 1)


def test_drivers_of_recorded_vehicles_remember_their_limited_desired_speed():
    """Resignation remembers v / v0, which begins with the desired speed that the driver has, at the start and later."""
    drivers = drivers_of("gaps")
    drivers = replace(drivers, effects=(EFFECTS["resignation"](jnp.asarray(0.5), jnp.asarray(10.0)),))
    places = (np.array([[0.0], [50.0]]), np.zeros((2, 1)), np.array([[18.0], [12.0]]))
    highest = jnp.array([[20.0], [40.0]])
    state = begin_driving(make_state(*places, MODEL, dtype=np.float64), drivers, MODEL, highest_speed=highest)
    np.testing.assert_array_equal(state.desired_speed, [[20.0], [28.0]])
    np.testing.assert_allclose(state.memory.effects[0], [[18.0 / 20.0], [12.0 / 28.0]])
    of_first = np.zeros((2, 2, 1))
    of_first[0, 0] = 1.0
    entering = {"is_new": of_first > 0, "x": 3.0 * of_first, "lane": of_first.astype(np.int32)}
    around = nobody(2, 2, 1, **entering, speed=11.0 * of_first, highest_speed=17.0 * of_first)
    after = quickly_compiled(lambda around: enter(state, around.second(0), drivers, MODEL))(around)
    np.testing.assert_allclose(after.memory.effects[0], [[11.0 / 17.0], [12.0 / 28.0]])

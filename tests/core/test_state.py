"""States and models that are refused, and defaults of values that are not given."""

import jax
import numpy as np
import pytest

from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, make_state, nearest_lane, nearest_level
from rearl_jax.problems import InvalidInputError
from tests.core.simulation import MODEL
from tests.refusal import refused


@pytest.mark.parametrize("name", ["x", "y", "speed", "heading", "desired_speed", "timer"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(name, bad):
    arrays = {key: np.full((4, 3), 4.0) for key in ("x", "y", "speed", "heading", "desired_speed", "timer")}
    arrays[name][2, 1] = bad
    with pytest.raises(InvalidInputError) as error:
        make_state(**arrays, model=MODEL)
    assert (error.value.code, error.value.problem.key) == ("not-a-number", f"{name}[2, 1]")
    controller = np.full((4, 3), Controller.IDM)
    controller[2, 1] = Controller.ABSENT
    state = make_state(**arrays, model=MODEL, controller=controller)
    assert all(np.isfinite(np.asarray(leaf)).all() for leaf in jax.tree.leaves(state))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("n_lanes", 0), ("n_lanes", 9), ("ticks_per_second", 0), ("lane_width", 0.0), ("road_length", np.nan)),
        *(("speed_limit", 0.0), ("speed_limit", np.nan), ("speed_levels", (5.0,)), ("speed_levels", (30.0, 20.0))),
        *(("speed_levels", (25.0, 25.0)), ("speed_levels", (5.0, np.nan)), ("speed_levels", (5.0, np.inf))),
    ],
)
def test_unusable_roads_and_clocks_are_refused(key, value):
    with pytest.raises(InvalidInputError) as error:
        TrafficModel(**{key: value})
    assert (error.value.code, error.value.problem.key) == ("out-of-range", key)


@pytest.mark.parametrize("delay", [0.0, -1.0, np.nan, np.inf])
def test_a_delay_after_which_no_decision_would_come_is_refused(delay):
    with refused("out-of-range", key="lane_change_delay"):
        make_state(np.array([10.0]), np.zeros(1), np.ones(1), MODEL, lane_change_delay=delay)


@pytest.mark.parametrize("lane", [-1, 4])
def test_a_target_lane_beside_the_road_is_refused(lane):
    places, lanes = np.array([10.0, 50.0]), np.array([3, lane])
    with refused("out-of-range", key="target_lane", value=lane):
        make_state(places, np.zeros(2), np.ones(2), MODEL, target_lane=lanes)
    controller = np.array([Controller.IDM, Controller.ABSENT])
    state = make_state(places, np.zeros(2), np.ones(2), MODEL, target_lane=lanes, controller=controller)
    np.testing.assert_array_equal(state.target_lane, [3, 0])


def test_clock_and_identity():
    assert TrafficModel(ticks_per_second=20).dt == 0.05
    assert hash(TrafficModel()) == hash(TrafficModel(n_lanes=4))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_defaults_are_those_of_the_constructors(dtype):
    x = np.array([[10.0, 11.3], [40.0, 41.0]])
    y = np.array([[0.0, 4.0], [9.9, 14.5]])
    speed = np.array([[20.0, 21.0], [22.0, 23.4]])
    controller = np.array([[1, 2], [1, 2]])
    state = make_state(x, y, speed, MODEL, controller=controller, dtype=dtype)
    for name in ("x", "y", "heading", "speed", "desired_speed", "push_x"):
        assert getattr(state, name).dtype == dtype
    np.testing.assert_array_equal(state.target_lane, [[0, 1], [2, 3]])
    # An IDM vehicle wants the speed it has, a META vehicle the nearest of 5, 8.375, ... 32 m/s.
    np.testing.assert_allclose(state.desired_speed, [[20.0, 21.875], [22.0, 21.875]], rtol=1e-6)
    # Timers start at ((x + y) pi) mod 1 s: here 0.416, 0.066, 0.765 and 0.358 s.
    phase = np.mod((x + y) * np.pi, 1.0)
    np.testing.assert_array_equal(state.ticks_to_decision, np.floor((1 - phase) * 15) + 1)


def test_nearest_lane_is_the_lower_one_on_the_line():
    y = np.array([-9.0, -2.0, 0.0, 1.99, 2.0, 2.01, 6.0, 10.0, 10.01, 13.0, 99.0])
    lanes = nearest_lane(jax.numpy.asarray(y), MODEL)
    np.testing.assert_array_equal(lanes, [0, 0, 0, 0, 0, 1, 1, 2, 3, 3, 3])


def test_nearest_level_rounds_halves_to_even():
    speed = np.array([-5.0, 5.0, 6.6875, 10.0625, 31.0, 50.0])
    for values in (speed, jax.numpy.asarray(speed)):
        np.testing.assert_array_equal(nearest_level(values, MODEL), [0, 0, 0, 2, 8, 8])

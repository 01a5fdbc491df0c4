"""Symmetries of one tick and of many, and changes that must matter to traffic."""

import jax
import numpy as np
import pytest

from rearl_jax.core.state import Controller, make_state
from rearl_jax.core.step import step
from tests.core import scenes, simulation
from tests.core.scenes import ROAD
from tests.core.simulation import MODEL, N_VEHICLES, TOLERANCES, assert_same_bits

N_CARS = 7
MOVING = ("x", "y", "heading", "speed", "acceleration", "target_lane", "ticks_to_decision", "crashed")


def driving_traffic(n_scenes, n_cars, *, seed=0):
    """Scenes in the order along the road, without contact, with desired speeds far apart."""
    traffic = []
    for number in range(n_scenes):
        rng = np.random.default_rng([seed, number])
        cars = scenes.draw_cars("road", n_cars, ROAD, rng)
        scenes.prepare(cars, ROAD, rng)
        for car in cars:
            car.crashed, car.target = False, car.lane
        scenes.to_single(cars)
        traffic.append(cars)
    return traffic


def stress_traffic(n_scenes, n_cars, *, seed=0):
    traffic = []
    for number in range(n_scenes):
        rng = np.random.default_rng([seed, number])
        cars = scenes.draw_cars(("stress", "meta", "pile")[number % 3], n_cars, ROAD, rng)
        scenes.prepare(cars, ROAD, rng)
        scenes.to_single(cars)
        for car in cars:
            for name in scenes.PARAMETERS:
                setattr(car, name, float(np.float32(getattr(car, name))))
        traffic.append(cars)
    return traffic


def test_order_of_the_list_decides_who_gives_way():
    """Three cars on their way into one lane, each within the desired gap of the next (43 m at 20 m/s) only.

    From the rear to the front everybody sees the others' old targets, so two give way. From the front to the rear the
    one in the middle has given way already when the last one looks.
    """
    cars = [scenes.car_on(0, x, 20.0, target=1) for x in (20.0, 50.0, 80.0)]
    state, drivers = simulation.core_of([cars, cars[::-1]])
    after = simulation.advance(state, drivers).target_lane[:3]
    np.testing.assert_array_equal(after[:, 0], [0, 0, 1])
    np.testing.assert_array_equal(after[::-1, 1], [1, 0, 1])


@pytest.mark.parametrize("slots", [(0, 1, 2, 3, 4, 5, 6), (3, 4, 5, 6, 7, 8, 9), (0, 2, 3, 5, 6, 8, 9)])
def test_slots_of_absent_vehicles_do_not_matter(slots):
    traffic = stress_traffic(200, N_CARS)
    states = []
    for chosen in (np.arange(N_CARS), np.array(slots)):
        state, drivers = simulation.core_of(traffic, slots=chosen)
        after = simulation.advance(state, drivers, n_ticks=20)
        states.append(jax.tree.map(lambda leaf, chosen=chosen: leaf[chosen], after))
        absent = np.setdiff1d(np.arange(N_VEHICLES), chosen)
        np.testing.assert_array_equal(after.x[absent], np.asarray(state.x)[absent])
        assert (after.speed[absent] == 0).all()
        assert not after.crashed[absent].any()
    assert states[0].crashed.mean() > 0.3
    assert_same_bits(*states, set(vars(states[0])) - {"order"})


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.thorough)])
def test_batch_and_padding_change_nothing(dtype):
    """A scene of seven in a batch, with three absent vehicles, is the same scene alone.

    Bit for bit where nobody is pushed: the sizes of pushes are sums of products, which a compiler rounds as suits the
    size of the batch.
    """
    traffic = stress_traffic(60, N_CARS) + driving_traffic(30, N_CARS)
    batch = simulation.core_of(traffic, dtype=dtype)
    alone = simulation.core_of(traffic, dtype=dtype, n_slots=N_CARS)
    single = jax.jit(lambda state, drivers: step(state, drivers, MODEL))
    together = simulation.history(*batch, n_ticks=10)
    one_by_one = []
    for number in range(len(traffic)):
        state, drivers = (simulation.columns(tree, number) for tree in alone)
        states = []
        for _ in range(10):
            state = single(state, drivers)
            states.append(state)
        one_by_one.append(jax.tree.map(lambda *leaves: np.stack(leaves), *states))
    one_by_one = jax.tree.map(lambda *leaves: np.stack(leaves, axis=-1), *one_by_one)
    together = jax.tree.map(lambda leaf: leaf[:, :N_CARS], together)
    lasting = tuple(set(vars(together)) - {"order"})
    free = np.flatnonzero(~one_by_one.is_pushed.any(axis=(0, 1)))
    assert one_by_one.is_pushed.any(axis=(0, 1)).sum() > 30
    assert len(free) > 20
    assert (np.diff(one_by_one.target_lane[..., free], axis=0) != 0).sum() > 10
    assert_same_bits(simulation.columns(together, free), simulation.columns(one_by_one, free), lasting)
    for name in lasting:
        a, b = (np.asarray(getattr(states, name), float) for states in (together, one_by_one))
        np.testing.assert_allclose(a, b, rtol=0, atol=TOLERANCES[dtype]["push"], err_msg=name)


def test_collisions_that_nobody_looks_for_do_not_happen():
    traffic = stress_traffic(60, N_VEHICLES)
    for cars in traffic:
        for car in cars:
            car.collides = car.crashed = False
    state, drivers = simulation.core_of(traffic)
    after = simulation.advance(state, drivers, n_ticks=5)
    assert not after.crashed.any()
    assert not after.is_pushed.any()
    drivers = simulation.default_drivers(state.x.shape)
    assert simulation.advance(state, drivers, n_ticks=5).crashed.mean() > 0.2


def test_absent_vehicles_need_no_sensible_numbers():
    """Not even finite ones: only their controller is looked at."""
    x = np.array([[10.0], [np.nan]])
    controller = np.array([[Controller.IDM], [Controller.ABSENT]])
    state = make_state(x, x, x, MODEL, heading=x * 0, controller=controller, dtype=np.float64)
    assert np.isfinite(np.asarray(state.x)).all()
    assert np.asarray(state.ticks_to_decision).max() <= 16

"""Contact: who is marked, who is pushed and how far, in cases that can be worked out by hand.

Dense pile-ups are among the recorded scenes of `test_step`.
"""

import numpy as np
import pytest

from rearl_jax.core.collisions import collide
from tests.core import simulation
from tests.core.scenes import Car, car_on
from tests.core.simulation import N_VEHICLES, advance, core_of

TICK = 1 / 15


def standing(x, y, *, speed=0.0, **others):
    """A car without engine or brakes, in the middle of a lane or turned: a tick only moves it on at its speed."""
    lane = round(y / 4)
    still = {"accel_limit": 0.0, "changes_lanes": False}
    return Car(float(x), float(y), speed, lane=lane, target=lane, **still, **others)


def contact(*cars, dtype=np.float64):
    """State after the next tick of one scene, without its scenario axis."""
    state, drivers = core_of([list(cars)], dtype=dtype)
    after = advance(state, drivers)
    return simulation.columns(after, 0)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_rear_end(dtype):
    """Overlap of 0.5 m along the road: both crash, each is pushed back by half of it, and stands there a tick later."""
    cars = [standing(100.0, 4.0), standing(104.5, 4.0)]
    after = contact(*cars, dtype=dtype)
    assert after.crashed[:2].all()
    np.testing.assert_array_equal(after.push_x[:2], [-0.25, 0.25])
    np.testing.assert_array_equal(after.push_y[:2], 0)
    state, drivers = core_of([cars], dtype=dtype)
    later = advance(state, drivers, n_ticks=2)
    np.testing.assert_allclose(later.x[:2, 0], [99.75, 104.75])


def test_driving_into_a_standing_car():
    """Contact is foreseen by a tick: pushed before it overlaps, crashed when the push is carried out."""
    speed, left = 6.0, 0.3  # 0.4 m per tick
    cars = [standing(100.0, 4.0, speed=speed), standing(105 + left + speed * TICK, 4.0)]
    after = contact(*cars)
    assert not after.crashed.any()
    depth = speed * TICK - left
    np.testing.assert_allclose(after.push_x[:2], [-depth / 2, depth / 2], rtol=1e-9)
    state, drivers = core_of([cars])
    later = advance(state, drivers, n_ticks=2)
    assert later.crashed[:2].all()
    np.testing.assert_allclose(np.diff(later.x[:2, 0]), 5.0)


def test_side_swipe():
    """Overlap of 0.4 m across the road is less than that along it: the cars part sideways."""
    after = contact(standing(100.0, 4.0), standing(101.0, 5.6))
    assert after.crashed[:2].all()
    np.testing.assert_allclose(after.push_y[:2], [-0.2, 0.2], atol=1e-12)
    np.testing.assert_allclose(after.push_x[:2], 0, atol=1e-12)


def test_turned_rectangles():
    """A corner of a car at 45 degrees reaches (L + W) / sqrt(8) = 2.475 m along the road."""
    reach = (5 + 2) / np.sqrt(8)
    for distance, touches in ((2.5 + reach - 0.05, True), (2.5 + reach + 0.05, False)):
        turned = standing(100 + distance, 4.0 + 0.75, heading=np.pi / 4)  # its rear corner meets the bumper
        after = contact(standing(100.0, 4.0), turned)
        assert after.crashed[:2].all() == touches
        assert after.is_pushed[:2].all() == touches


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_of_several_partners_the_last_in_the_list_pushes(order):
    """The car in the middle overlaps by 0.5 m in front and 1 m behind; only one push is left over."""
    chain = [standing(96.0, 4.0), standing(100.0, 4.0), standing(104.5, 4.0)]
    after = contact(*(chain[i] for i in order))
    pushes = dict(zip(order, after.push_x[:3], strict=True))
    assert after.crashed[:3].all()
    np.testing.assert_allclose([pushes[0], pushes[2]], [-0.5, 0.25])
    last = max((0, 2), key=order.index)
    np.testing.assert_allclose(pushes[1], {0: 0.5, 2: -0.25}[last])


def test_resting_contact_counts():
    """A gap of exactly nothing is contact, and pushes nobody anywhere."""
    after = contact(standing(100.0, 4.0), standing(105.0, 4.0))
    assert after.crashed[:2].all()
    assert after.is_pushed[:2].all()
    np.testing.assert_array_equal(after.push_x[:2], 0)
    after = contact(standing(100.0, 4.0), standing(105.0 + 2e-13, 4.0))
    assert not after.crashed[:2].any()
    assert not after.is_pushed[:2].any()


def test_one_of_two_has_to_look():
    overlapping = (standing(100.0, 4.0, collides=False), standing(104.0, 4.0, collides=False))
    after = contact(*overlapping)
    assert not after.crashed.any()
    assert not after.is_pushed.any()
    for looks in (0, 1):
        pair = [standing(100.0, 4.0, collides=looks == 0), standing(104.0, 4.0, collides=looks == 1)]
        after = contact(*pair)
        assert after.crashed[:2].all()


def test_size_of_the_vehicles_counts():
    for length, touches in ((7.9, False), (8.1, True)):
        after = contact(standing(100.0, 4.0, length=length), standing(106.5, 4.0))
        assert after.crashed[:2].all() == touches
    for width, touches in ((3.9, False), (4.1, True)):
        after = contact(standing(100.0, 4.0, width=width), standing(100.5, 7.0))
        assert after.crashed[:2].all() == touches


def test_crashed_vehicles_come_to_rest_where_they_point():
    """Speed falls to 14/15 with every tick, the heading stays."""
    cars = [car_on(1, 100.0, 20.0, heading=0.1, crashed=True)]
    state, drivers = core_of([cars])
    states = simulation.history(state, drivers, n_ticks=30)
    np.testing.assert_allclose(states.speed[:, 0, 0], 20 * (14 / 15) ** np.arange(1, 31), rtol=1e-12)
    np.testing.assert_array_equal(states.heading[:, 0, 0], np.asarray(state.heading)[0, 0])
    np.testing.assert_allclose(np.diff(states.y[:, 0, 0]) / np.diff(states.x[:, 0, 0]), np.tan(0.1), rtol=1e-9)


def test_far_apart_nobody_is_touched():
    grid = [standing(20.0 * (i // 3), 4.0 * (i % 3)) for i in range(N_VEHICLES)]
    state, drivers = core_of([grid])
    after = collide(state, drivers.body, simulation.MODEL)
    assert not np.asarray(after.crashed).any()
    assert not np.asarray(after.is_pushed).any()

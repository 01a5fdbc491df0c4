"""Contact: who is marked, who is pushed and how far, in cases that can be worked out by hand.

Dense pile-ups are among the recorded scenes of `test_step`.
"""

import numpy as np
import pytest

from tests.core import simulation
from tests.core.scenes import Car
from tests.core.simulation import advance, core_of

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


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.thorough)])
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

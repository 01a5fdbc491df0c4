"""Ticks between lane-change decisions."""

import numpy as np
import pytest

from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.timer import decision_period, ticks_until_decision
from tests.core import simulation
from tests.core.reference import ticks_to_exceed
from tests.core.scenes import car_on


@pytest.mark.parametrize(("ticks_per_second", "period"), [(5, 6), (10, 11), (15, 16), (20, 20), (25, 25), (30, 31)])
def test_period_is_that_of_float_additions(ticks_per_second, period):
    """Measured with highway-env 1.12.1, whose timer adds 1/f s in float64."""
    assert decision_period(1.0, ticks_per_second) == period
    assert highway_env_drivers(ticks_per_second=ticks_per_second).mobil.decision_period.item() == period


def test_ticks_until_any_first_decision():
    timers = np.concatenate([np.random.default_rng(0).uniform(-0.5, 1.5, 500), np.arange(0, 31) / 15, [1.0]])
    for rate, delay in ((15, 1.0), (10, 1.0), (15, 0.4)):
        expected = [ticks_to_exceed(timer, delay, 1 / rate) for timer in timers]
        ticks = ticks_until_decision(timers, delay, rate)
        assert ticks.dtype == np.int32
        np.testing.assert_array_equal(ticks, expected)
    assert ticks_until_decision(np.array(1.0), 1.0, 15) == 1  # must exceed, not reach
    assert ticks_until_decision(np.array(1.1), 1.0, 15) == 0


def test_decisions_are_sixteen_ticks_apart():
    """A car alone never changes lanes; its countdown runs from 16 whenever it has decided."""
    state, drivers = simulation.core_of([[car_on(1, 100.0, 20.0, timer=0.0)]])
    countdown = simulation.history(state, drivers, n_ticks=50).ticks_to_decision[:, 0, 0]
    first = ticks_to_exceed(0.0, 1.0, 1 / 15)
    assert first == 16
    expected = [(first - 1 - tick) % 16 if tick != first else 15 for tick in range(50)]
    np.testing.assert_array_equal(countdown, expected)


def test_countdown_waits_for_the_end_of_a_change():
    """Time runs on during a change, and the next decision falls on the tick after the lane line is crossed."""
    cars = [car_on(0, 100.0, 3.0, desired=3.0, target=1, timer=0.5)]
    states = simulation.history(*simulation.core_of([cars]), n_ticks=60)
    lane = (states.y[:, 0, 0] > 2).astype(int)
    crossing = int(np.argmax(lane))
    assert 8 < crossing < 50
    countdown = states.ticks_to_decision[:, 0, 0]
    assert (np.diff(countdown[: crossing + 1]) == -1).all()
    assert countdown[crossing] < 0
    assert countdown[crossing + 1] == 15

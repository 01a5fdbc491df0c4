"""Ticks between lane-change decisions."""

import numpy as np
import pytest

from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.timer import decision_period, ticks_until_decision
from tests.core.reference import ticks_to_exceed


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

"""The linear analysis: short steps agree with continuous time, rings with closed forms, delays destabilise."""

import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.car_following.model import Linearisation
from rearl_jax.study.stability.analysis import Scheme, amplification, ring_growth

STABLE = Linearisation(jnp.asarray(0.1), jnp.asarray(-0.4), jnp.asarray(-0.3))
UNSTABLE = Linearisation(jnp.asarray(0.25), jnp.asarray(-0.3), jnp.asarray(-0.2))


@pytest.mark.parametrize("slopes", [STABLE, UNSTABLE])
def test_short_steps_amplify_as_continuous_time(slopes):
    for frequency in (0.01, 0.05, 0.2):
        expected = float(slopes.amplification(jnp.asarray(2 * np.pi * frequency)))
        assert amplification(slopes, Scheme(1e-5), frequency) == pytest.approx(expected, rel=1e-4)


def test_signs_of_growth_are_those_of_the_stability_margin():
    assert STABLE.stability_margin() > 0 > UNSTABLE.stability_margin()
    assert ring_growth(STABLE, Scheme(1e-4), 22).max() < 0 < ring_growth(UNSTABLE, Scheme(1e-4), 22).max()


def test_waves_without_delay_solve_a_quadratic_equation():
    n, dt = 6, 0.1
    gap, speed, approach = (float(slope) for slope in UNSTABLE)
    expected = []
    for j in (1, 2, 3):
        turn = np.exp(2j * np.pi * j / n)
        p = np.roots([1, -(speed + approach * (1 - turn)), gap * (1 - turn)])
        expected.append(np.log(np.abs(1 + dt * p).max()) / dt)
    np.testing.assert_allclose(ring_growth(UNSTABLE, Scheme(dt), n), expected, rtol=1e-9)


def test_delays_destabilise_and_fractions_of_steps_interpolate():
    growth = [ring_growth(STABLE, Scheme(0.1, delay, delay), 22) for delay in (0.0, 0.3, 0.35, 0.4, 1.2)]
    assert growth[0].max() < 0 < growth[-1].max()
    assert growth[1][-1] < growth[2][-1] < growth[3][-1]
    late = Scheme(0.1, 0.3)
    z = np.exp(2j * np.pi * 0.1 * 0.1)
    p = (z - 1) / 0.1
    gap, speed, approach = (float(slope) for slope in STABLE)
    expected = abs((gap - approach * p) / z**3 / (p * p - (speed + approach) * p + gap / z**3))
    assert amplification(STABLE, late, 0.1) == pytest.approx(expected, rel=1e-9)

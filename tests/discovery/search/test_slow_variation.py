"""Slow variation of the time gap within drivers, from the autocovariance of the acceleration residual."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.read.lasting import lasting
from rearl_jax.discovery.search.headway import TimeGapVariation
from rearl_jax.discovery.search.null import null_of
from rearl_jax.discovery.search.simulated_drives import noise_alone, simulate_again
from rearl_jax.discovery.search.slow_variation import slow_variation

SD = 0.3


def driven(solver, many, sd):
    """Drivers on drives that they made themselves, with a time gap that varied by `sd` over 20 s."""
    state, noise = many
    varied = lasting(sd, 20.0, state.data.y.shape, state.data.dt, np.random.default_rng(4))
    varying = replace(state, pieces=replace(state.pieces, varied=varied))
    again = simulate_again(solver, varying, noise, np.random.default_rng(5))
    assert again.pieces.varied is None
    solver.solve([again], iterations=12, tolerance=0.1)
    return again


@pytest.mark.parametrize("sd", [0.0, pytest.param(SD, marks=pytest.mark.slow)])
def test_the_variation_of_the_drives_is_found(solver, many, sd):
    found = slow_variation(solver, driven(solver, many, sd), many[1], 0)
    assert found.sd == pytest.approx(sd, abs=0.1)
    assert found.noise_share == 1.0
    assert not found.start_share


@pytest.mark.slow
def test_chance_is_larger_behind_drivers_who_vary(solver, many):
    state, noise = driven(solver, many, SD), many[1]
    varying = null_of(solver, state, noise, 8, 0)
    constant = null_of(solver, driven(solver, many, 0.0), noise, 8, 0)
    wider = [term for term in varying.mean if varying.threshold(4.5)[term] > constant.threshold(4.5)[term] + 1.0]
    assert len(wider) > 0.2 * len(varying.mean)


def test_a_constant_time_gap_is_the_default(solver, many):
    (plain,), (constant,) = (
        next(iter(noise_alone(solver, *many, 1, 0, *drawn)))
        for drawn in ((), (lambda rng: TimeGapVariation().drawn(many[0], solver.layout.prior, rng),))
    )
    np.testing.assert_array_equal(plain.data.y, constant.data.y)
    assert np.ptp(plain.data.y - many[0].data.y) > 0.1

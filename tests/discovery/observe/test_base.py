"""The calibrated base model: less weight near changes of leader, where drivers are predicted worse."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.base import weighted_near_changes
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.noise import under_best_noise
from rearl_jax.discovery.observe.observer import is_near_change, relative_variance, weights
from rearl_jax.discovery.search.simulated_drives import simulate_again


def changing(many):
    """Drivers whose leader has changed at the middle of every drive."""
    state, noise = many
    seconds = np.arange(len(state.data.y))[:, None] * state.data.dt
    since = np.where(seconds < seconds[-1] / 2, 1e9, seconds - seconds[-1] / 2) + 0 * state.data.y
    seen = replace(state.data.surroundings, time_since_change=since, time_to_next=np.full_like(since, 1e9))
    return replace(state, data=replace(state.data, surroundings=seen)), noise


def test_innovations_near_changes_vary_more_and_weigh_less(many):
    state, noise = changing(many)
    near = is_near_change(state.data)
    assert 0.1 < near.mean() < 0.5
    wide, growth = replace(noise, near_changes=3.0), 1 + 3 * near
    np.testing.assert_allclose(relative_variance(state.data, wide), relative_variance(state.data, noise) * growth)
    np.testing.assert_allclose(weights(state.data, wide) * growth, weights(state.data, noise))


@pytest.mark.parametrize("growth", [pytest.param(0.0, marks=pytest.mark.slow), 8.0])
def test_the_growth_of_noise_near_changes_is_found(solver, many, growth):
    state, noise = changing(many)
    wide = replace(noise, near_changes=growth)
    drives = simulate_again(solver, state, wide, np.random.default_rng(5))
    solver.solve([drives], iterations=12, tolerance=0.1)
    found = weighted_near_changes(solver, Fit(None, drives, noise))
    assert (found is None or found.noise.near_changes < 0.5) if growth == 0 else found is not None
    if growth and found is not None:
        assert 0.3 * growth < found.noise.near_changes < 2 * growth
        assert found.noise.acceleration <= noise.acceleration * 1.5


@pytest.mark.parametrize("is_changing", [True, False])
def test_episodes_near_changes_do_not_enlarge_the_noise(solver, many, is_changing):
    state, noise = changing(many)
    drives = simulate_again(solver, state, replace(noise, near_changes=30.0), np.random.default_rng(5))
    solver.solve([drives], iterations=12, tolerance=0.1)
    # Without changes in the data, the same episodes cannot be told from the drivers' usual noise.
    drives = (
        drives if is_changing else replace(drives, data=replace(drives.data, surroundings=many[0].data.surroundings))
    )
    _, found = under_best_noise(solver, drives, noise)
    assert (found.acceleration <= 1.5 * noise.acceleration) == is_changing

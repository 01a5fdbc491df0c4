"""Random initial traffic: reproducible, and distributed as highway-env draws it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import Controller
from rearl_jax.core.timer import ticks_until_decision
from tests.core.simulation import MODEL

N_VEHICLES, N_SCENARIOS = 12, 400


def keys(n, seed=0):
    return jax.random.split(jax.random.key(seed), n)


def spawned(n_scenarios, model, **options):
    """State and drivers as NumPy arrays."""
    draw = jax.jit(lambda keys: spawn(keys, model, **options), compiler_options=QUICKLY_COMPILED)
    return jax.tree.map(np.asarray, draw(keys(n_scenarios)))


@pytest.fixture(scope="module")
def traffic():
    return spawned(N_SCENARIOS, MODEL, n_vehicles=N_VEHICLES, dtype=jnp.dtype(jnp.float64))


def kolmogorov_smirnov(sample, low, high):
    """Largest difference of the distribution functions of a sample and of the uniform one, times sqrt(n)."""
    sample = np.sort((np.ravel(sample) - low) / (high - low))
    steps = np.arange(sample.size + 1) / sample.size
    assert sample[0] >= 0
    assert sample[-1] <= 1
    return np.sqrt(sample.size) * max(abs(sample - steps[1:]).max(), abs(sample - steps[:-1]).max())


LIMIT = 1.95
"""Exceeded once in a thousand uniform samples. Source: Kolmogorov distribution."""


def test_speeds_are_70_to_80_percent_of_the_limit(traffic):
    state, _ = traffic
    assert kolmogorov_smirnov(state.speed, 21.0, 24.0) < LIMIT
    np.testing.assert_array_equal(state.desired_speed, state.speed)


def test_spacing(traffic):
    """0.9 to 1.1 times (12 + v) exp(-5 K / 40) / density ahead of the vehicle before; the first after three of them."""
    state, _ = traffic
    offset = (12 + state.speed) * np.exp(-5 * 4 / 40) / 2
    share = np.diff(state.x, axis=0) / offset[1:]
    assert kolmogorov_smirnov(share, 0.9 - 1e-9, 1.1 + 1e-9) < LIMIT
    first = state.x[0] / offset[0] - 3
    assert kolmogorov_smirnov(first, 0.9 - 1e-9, 1.1 + 1e-9) < LIMIT


@pytest.mark.parametrize(("density", "n_lanes"), [(0.5, 2), (2.0, 8)])
def test_spacing_follows_density_and_number_of_lanes(density, n_lanes):
    model = TrafficModel(n_lanes=n_lanes)
    state, _ = spawned(20, model, n_vehicles=6, density=density)
    share = np.diff(state.x, axis=0) / ((12 + state.speed[1:]) * np.exp(-5 * n_lanes / 40) / density)
    assert 0.9 - 1e-4 < share.min() < 0.95
    assert 1.05 < share.max() < 1.1 + 1e-4
    assert set(np.unique(state.target_lane)) == set(range(n_lanes))


def test_exponents(traffic):
    _, drivers = traffic
    assert drivers.car_following.accel_exponent.shape == (N_VEHICLES, N_SCENARIOS)
    assert kolmogorov_smirnov(drivers.car_following.accel_exponent, 3.5, 4.5) < LIMIT


def test_lanes_are_equally_likely_and_vehicles_in_their_middle(traffic):
    state, _ = traffic
    counts = np.bincount(state.target_lane.ravel(), minlength=4)
    expected = counts.sum() / 4
    assert ((counts - expected) ** 2 / expected).sum() < 16.3  # chi-squared, three degrees of freedom, 1 in 1000
    np.testing.assert_array_equal(state.y, 4.0 * state.target_lane)


def test_draws_are_independent(traffic):
    """No draw tells anything of another one."""
    state, drivers = traffic
    offset = (12 + state.speed) * np.exp(-0.5) / 2
    share = np.diff(state.x, axis=0) / offset[1:]
    columns = [
        state.speed[1:],
        share,
        drivers.car_following.accel_exponent[1:],
        state.target_lane[1:],
        state.speed[:-1],
    ]
    correlation = np.corrcoef([np.ravel(column) for column in columns]) - np.eye(len(columns))
    assert abs(correlation).max() < 4 / np.sqrt(share.size)


def test_phase_of_decisions_comes_from_the_place(traffic):
    """The timer starts at ((x + y) pi) mod 1 s."""
    state, _ = traffic
    phase = ((state.x + state.y) * np.pi) % 1.0
    ticks = ticks_until_decision(phase, 1.0, 15)
    # Float additions and a division may disagree where a timer meets a whole tick to the last place.
    edge = abs((1 - phase) * 15 - np.round((1 - phase) * 15)) < 1e-9
    assert edge.mean() < 1e-3
    np.testing.assert_array_equal(state.ticks_to_decision[~edge], ticks[~edge])
    assert set(np.unique(ticks)) == set(range(1, 16))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_same_key_same_scenario_whatever_the_batch(dtype):
    many = keys(37)
    draw = jax.jit(
        lambda keys: spawn(keys, MODEL, n_vehicles=N_VEHICLES, dtype=jnp.dtype(dtype)),
        compiler_options=QUICKLY_COMPILED,
    )
    together = draw(many)
    assert together[0].x.dtype == dtype
    assert np.unique(np.asarray(together[0].x)[0]).size == 37
    for chosen in ([5], [36, 5, 0, 1]):
        part = draw(many[np.array(chosen)])
        for a, b in zip(jax.tree.leaves(part), jax.tree.leaves(together), strict=True):
            wanted = b if b.shape[-1] == 1 else np.asarray(b)[..., np.array(chosen)]
            np.testing.assert_array_equal(a, wanted)


def test_everything_else_is_at_rest(traffic):
    state, _ = traffic
    for name in ("heading", "acceleration", "x_lost", "y_lost", "push_x", "push_y"):
        assert not getattr(state, name).any()
    assert not state.crashed.any()
    assert not state.is_pushed.any()
    assert (state.controller == Controller.IDM).all()
    np.testing.assert_array_equal(np.take_along_axis(state.x, state.order, axis=0), np.sort(state.x, axis=0))


def test_fixed_speed_and_road_without_limit():
    state, _ = spawned(20, MODEL, n_vehicles=5, initial_speed=25.0)
    np.testing.assert_array_equal(state.speed, 25.0)
    state, _ = spawned(200, TrafficModel(speed_limit=None), n_vehicles=5)
    assert kolmogorov_smirnov(state.speed, 23.0, 25.0) < LIMIT

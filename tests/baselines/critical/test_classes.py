"""Driver classes: their parameters reach the vehicles, nothing else changes, and they drive as they are called."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.baselines.critical.classes import CLASSES, populate
from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.spawn import spawn, ticks_to_first_decision
from rearl_jax.core.timer import decision_period, ticks_until_decision

N_VEHICLES, N_SCENARIOS = 10, 300


@pytest.fixture(scope="module")
def model():
    return TrafficModel(cooperative=True, collisions=False)


@pytest.fixture(scope="module")
def drawn(model):
    """Keys, and the traffic and drivers of the method base drawn from them."""
    keys = jax.random.split(jax.random.key(3), N_SCENARIOS)
    draw = jax.jit(lambda keys: spawn(keys, model, n_vehicles=N_VEHICLES, density=2.0, dtype=jnp.dtype("float32")))
    return keys, *draw(keys)


@cache
def compiled(model):
    return jax.jit(lambda state, drivers, keys, shares: populate(state, drivers, keys, shares, model))


def populated(drawn, model, *mixture):
    keys, state, drivers = drawn
    shares = jnp.broadcast_to(jnp.asarray(mixture, jnp.float32)[:, None], (3, N_SCENARIOS))
    return compiled(model)(state, drivers, keys, shares)


def some(leaves):
    """The first scenarios."""
    return jax.tree.map(lambda leaf: leaf[..., :40] if leaf.shape[-1] == N_SCENARIOS else leaf, leaves)


ALONE = {
    "aggressive": (1.0, 0.0, 0.0),
    "defensive": (0.0, 1.0, 0.0),
    "truck": (0.0, 0.0, 1.0),
    "regular": (0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("name", ALONE)
def test_parameters_of_a_class_reach_every_driver(drawn, model, name):
    state, drivers = populated(drawn, model, *ALONE[name])
    kind = CLASSES[name]
    for values, wanted in (
        (drivers.car_following.max_accel, kind.max_accel),
        (drivers.car_following.jam_spacing, kind.jam_spacing),
        (drivers.mobil.gain_threshold, kind.gain_threshold),
        (drivers.mobil.politeness, kind.politeness),
        (drivers.mobil.decision_period, decision_period(kind.delay, model.ticks_per_second)),
    ):
        assert values.shape == state.x.shape
        np.testing.assert_allclose(values, wanted, rtol=1e-6)
    speed = np.asarray(state.speed)
    np.testing.assert_array_equal(speed, state.desired_speed)
    assert speed.min() >= 5.0
    assert speed.max() <= 32.0
    normal = np.random.default_rng(0).normal(kind.mean_speed, kind.speed_sd, 100_000)
    expected = np.clip(normal, 5.0, 32.0)
    assert speed.mean() == pytest.approx(expected.mean(), abs=0.2)
    assert speed.std() == pytest.approx(expected.std(), abs=0.2)


def test_the_values_are_those_of_critical_and_trucks_keep_the_constants_of_highway_env():
    assert [*CLASSES] == [*Mixture._fields, "regular"]
    aggressive = CLASSES["aggressive"]
    assert (aggressive.delay, aggressive.politeness, aggressive.mean_speed) == (0.3, 0.05, 33.5)
    assert CLASSES["defensive"].delay == 3.0
    ours, theirs = CLASSES["truck"], highway_env_drivers()
    own = (ours.max_accel, ours.jam_spacing, ours.gain_threshold, ours.politeness)
    mobil = theirs.mobil
    highway = (theirs.car_following.max_accel, theirs.car_following.jam_spacing, mobil.gain_threshold, mobil.politeness)
    assert own == pytest.approx([float(value.squeeze()) for value in highway])


def test_lanes_places_and_exponents_are_those_of_base(drawn, model):
    """Also the phase of the decisions, for drivers that decide as often."""
    _, base, base_drivers = drawn
    for mixture in ALONE.values():
        state, drivers = populated(drawn, model, *mixture)
        for name in ("x", "y", "target_lane", "heading", "order", "controller"):
            np.testing.assert_array_equal(getattr(state, name), getattr(base, name))
        np.testing.assert_array_equal(drivers.car_following.accel_exponent, base_drivers.car_following.accel_exponent)
    for name in ("regular", "truck"):
        state, _ = populated(drawn, model, *ALONE[name])
        np.testing.assert_array_equal(state.ticks_to_decision, base.ticks_to_decision)


def test_shares_are_the_frequencies(drawn, model):
    state, drivers = populated(drawn, model, 0.2, 0.3, 0.1)
    kinds = np.asarray(drivers.car_following.max_accel)
    found = [np.isclose(kinds, accel).mean() for accel in (4.5, 2.0, 3.0, 3.2)]
    assert found == pytest.approx([0.2, 0.3, 0.1, 0.4], abs=0.03)
    assert np.isclose(kinds[0], 4.5).mean() == pytest.approx(0.2, abs=0.08)  # wherever in the list


def test_a_vehicle_of_the_same_class_is_the_same_in_another_mixture(drawn, model):
    one, one_drivers = populated(drawn, model, 0.2, 0.3, 0.1)
    other, other_drivers = populated(drawn, model, 0.2, 0.1, 0.4)
    same = np.isclose(one_drivers.car_following.max_accel, other_drivers.car_following.max_accel)
    assert 0.5 < same.mean() < 0.9
    np.testing.assert_array_equal(np.asarray(one.speed)[same], np.asarray(other.speed)[same])


@pytest.mark.parametrize("delay", [0.3, 1.0, 3.0])
def test_the_first_decision_is_when_highway_envs_timer_says(drawn, model, delay):
    """Counted with the same additions on the host, in float64; rounding may shift one by a tick."""
    state = drawn[1]
    ticks = np.asarray(ticks_to_first_decision(state.x, state.y, delay, decision_period(delay, 15), 15))
    place = np.asarray(state.x, np.float64) + np.asarray(state.y, np.float64)
    wanted = ticks_until_decision((place * np.pi) % delay, delay, 15)
    assert ticks.min() >= 1
    assert (np.abs(ticks - wanted) <= 1).mean() > 0.999
    assert (ticks == wanted).mean() > 0.95


@pytest.mark.slow
def test_classes_drive_as_they_are_called(drawn, model):
    """Aggressive drivers are faster than defensive ones, and their lanes are others."""
    simulate = jax.jit(lambda state, drivers: rollout(state, drivers, model, n_seconds=12)[1])
    aggressive, defensive = (simulate(*some(populated(drawn, model, *ALONE[n]))) for n in ("aggressive", "defensive"))
    assert np.asarray(aggressive.speed)[-1].mean() > np.asarray(defensive.speed)[-1].mean() + 3.0
    assert (np.asarray(aggressive.lane)[-1] != np.asarray(defensive.lane)[-1]).any()

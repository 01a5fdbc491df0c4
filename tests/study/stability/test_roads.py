"""Rings of the core: an equilibrium lasts, everybody is seen across the seam, overlaps are counted once."""

import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.stability import StabilityConfig, StudyStabilityTask
from rearl_jax.study.stability.cases import cases_of
from rearl_jax.study.stability.flow import wave_speeds
from rearl_jax.study.stability.rings import growth_rate, waves_grow
from rearl_jax.study.stability.roads import Motion, drive, gaps


@pytest.fixture(scope="module")
def case():
    (case,) = cases_of(StudyStabilityTask(stability=StabilityConfig(models=("idm",))))
    return case


@pytest.mark.slow
def test_a_ring_in_equilibrium_stays_in_it_and_a_disturbance_passes_the_seam(case):
    n, speed = 5, 10.0
    spacing = case.length + float(case.equilibrium_gaps(np.array([speed]))[0])
    even = -np.arange(n)[:, None] * spacing
    disturbed = even.copy()
    disturbed[-1] -= 5.0  # the last vehicle is the leader of the first
    position = np.concatenate([even, disturbed], axis=1)
    motion = drive(
        case.typical,
        position,
        np.full(position.shape, speed),
        seconds=20,
        seed=0,
        circumference=np.full(2, n * spacing),
    )
    np.testing.assert_allclose(motion.speed[:, :, 0], speed, atol=1e-9)
    np.testing.assert_allclose(motion.position[-1, :, 0], even[:, 0] + 20 * speed, atol=1e-6)
    assert motion.speed[1, 0, 1] < speed - 0.1
    assert not motion.overlaps.any()


@pytest.mark.slow
def test_vehicles_that_cannot_stop_overlap_once(case):
    position = np.array([[40.0], [0.0]])
    motion = drive(case.typical, position, np.array([[0.0], [35.0]]), seconds=10, seed=0)
    np.testing.assert_array_equal(motion.overlaps[:, 0], [0, 1])


def test_gaps_of_rings_and_roads():
    x, length = jnp.asarray([[50.0], [30.0]]), jnp.asarray([[4.0], [6.0]])
    np.testing.assert_allclose(gaps(x, length, jnp.asarray([100.0]))[:, 0], [75.0, 15.0])
    np.testing.assert_allclose(gaps(x, length, None)[:, 0], [np.inf, 15.0])


def test_growth_and_decay_are_told_apart():
    time = np.arange(900.0)
    growing, decaying = 1e-3 * np.exp(0.004 * time), 1e-3 * np.exp(-0.004 * time)
    assert growth_rate(growing) == pytest.approx(0.004)
    assert growth_rate(decaying) == pytest.approx(-0.004)
    assert waves_grow(growing)
    assert not waves_grow(decaying)
    assert waves_grow(np.minimum(1e-3 * np.exp(0.1 * time), 3.0))  # grown up long before the end
    assert not waves_grow(np.maximum(decaying, 1e-12) * 1e-9)


@pytest.mark.parametrize("crests", [1, 2, 5])
def test_the_speed_of_a_wave_is_that_of_its_phase(crests):
    time, length, n = np.arange(100.0)[:, None, None], 600.0, 30
    position = 8.0 * time - 20.0 * np.arange(n)[:, None]
    speed = 8.0 + np.cos(2 * np.pi * crests * (position + 4.0 * time) / length)
    motion = Motion(position, speed, np.zeros((n, 1), int))
    np.testing.assert_allclose(wave_speeds(motion, np.array([length]), 100), [-4.0], atol=1e-6)

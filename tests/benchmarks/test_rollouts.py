import jax
import numpy as np
import pytest

from benchmarks.rollouts import Rollouts
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.spawn import spawn

N_VEHICLES, SECONDS, DENSITY, N_SCENARIOS = 6, 12, 4.0, 20


@pytest.fixture(scope="module")
def rollouts():
    return Rollouts(N_VEHICLES, SECONDS, DENSITY, chunk=8)


@pytest.mark.thorough
def test_counts_what_the_core_simulates(rollouts):
    run = rollouts.measure(N_SCENARIOS, 3)  # the last chunk is not full
    model = TrafficModel()

    @jax.jit
    def simulate(keys):
        state, drivers = spawn(keys, model, n_vehicles=N_VEHICLES, density=DENSITY)
        return rollout(state, drivers, model, n_seconds=SECONDS)[1]

    frames = simulate(jax.random.split(jax.random.key(3), N_SCENARIOS))
    changes = int(np.count_nonzero(np.diff(np.asarray(frames.lane), axis=0)))
    crashed = int(np.count_nonzero(frames.crashed[-1]))
    assert changes > 0
    assert crashed > 0
    assert (run.lane_changes, run.crashed) == (changes, crashed)
    assert run.mean_speed == pytest.approx(float(np.mean(np.asarray(frames.speed[-1], np.float64))), rel=1e-6)
    assert frames.speed.dtype == np.float32
    assert run.n_substeps == N_SCENARIOS * N_VEHICLES * SECONDS * 15
    assert run.cpu_s > 0
    assert run.peak_memory_bytes > 0


@pytest.mark.thorough
def test_facts(rollouts):
    assert rollouts.facts["chunk"] == 8
    assert rollouts.facts["unit"] == 8 * len(jax.local_devices())
    assert rollouts.facts["compile_s"] > 0

"""Small decision steps, really measured."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from rearl_jax.timing import decision_steps as module
from rearl_jax.timing.decision_steps import BASE, DECISION, DETECTION, PPO, decision_steps
from rearl_jax.timing.process import ProcessSession
from rearl_jax.timing.synthetic_references import synthetic_references

N_VEHICLES, SECONDS, BATCH = 4, 8, 4
SCENE = {
    "n_vehicles": N_VEHICLES,
    "density": 2.0,
    "seconds": SECONDS,
    "batch": BATCH,
    "references": {"seed": 0, "n_references": 15, "n_seconds": SECONDS, "n_vehicles": 10},
}


def traffic(run):
    return run.n_scenarios, run.mean_speed, run.lane_changes, run.crashed


def test_unknown_parts_are_refused():
    with pytest.raises(ValueError, match="no part 'nothing' of a decision step: base, ppo, loop, detection, decision"):
        decision_steps("nothing", **SCENE)


@pytest.mark.slow
def test_parts_of_decision_steps_look_at_the_traffic_before_those_that_simulate(monkeypatch):
    for name in ("BASE_MODEL", "LOOP_MODEL"):  # compile faster
        monkeypatch.setattr(module, name, replace(getattr(module, name), collisions=False))
    parts = {name: decision_steps(name, **SCENE) for name in (DETECTION, DECISION)}
    looked = {name: part.measure(BATCH, 2) for name, part in parts.items()}
    assert traffic(looked[DETECTION]) == traffic(looked[DECISION])
    keys = jax.random.split(jax.random.key(2), (1, BATCH))[0]
    batch = parts[DECISION]._prepare(keys)
    assert batch.recorded.x.shape == (SECONDS, N_VEHICLES, BATCH)
    np.testing.assert_array_equal(batch.recorded.x[-1], batch.state.x)  # the others go on from there
    reference, _, mape, triggered, n_asked = parts[DETECTION]._run(parts[DETECTION]._prepare(keys))
    orders, decisions = jax.tree.map(np.asarray, parts[DECISION]._run(batch))
    np.testing.assert_array_equal(reference, decisions.reference)
    np.testing.assert_allclose(mape, decisions.mape, rtol=1e-5)
    assert np.asarray(triggered).all()
    # Orders of a second are carried to the next one; the last ones are handed over.
    np.testing.assert_array_equal(decisions.n_asked[1:], n_asked[:-1])
    np.testing.assert_array_equal(orders.is_asked.sum(axis=0), n_asked[-1])
    assert np.asarray(n_asked).any()
    told = decisions.n_accepted.sum(axis=1) + decisions.n_inadmissible + decisions.n_invalid
    np.testing.assert_array_equal(told, decisions.n_asked)


@pytest.mark.slow
def test_ppo_drives_everybody_in_its_decision_steps(monkeypatch):
    monkeypatch.setattr(module, "BASE_MODEL", replace(module.BASE_MODEL, collisions=False))
    base, driven = (decision_steps(name, **SCENE).measure(BATCH, 2) for name in (BASE, PPO))
    assert driven.n_substeps == base.n_substeps
    assert driven.mean_speed > base.mean_speed + 1  # it was trained to be fast


def test_references_have_the_shapes_of_a_study_and_follow_from_the_seed():
    references = synthetic_references(0, 15, 60, 10)
    assert references.speed.shape == references.spacing.shape == references.action.shape == (15, 60, 10)
    speed = np.asarray(references.speed)
    assert speed.min() >= 5
    assert speed.max() <= 32
    assert np.ptp(speed.mean(axis=(1, 2))) > 5  # they differ, or there would be nothing to choose
    np.testing.assert_allclose(references.mean_spacing, np.asarray(references.spacing).mean(axis=-1), rtol=1e-6)
    shares = np.bincount(np.asarray(references.action).ravel(), minlength=5) / references.action.size
    assert (shares > 0).all()
    assert shares[0] + shares[2] < 0.02
    assert float(references.share.sum()) == pytest.approx(1)
    again, other = synthetic_references(0, 15, 60, 10), synthetic_references(1, 15, 60, 10)
    np.testing.assert_array_equal(again.speed, references.speed)
    assert (np.asarray(other.speed) != speed).any()


@pytest.mark.slow
def test_a_process_serves_a_part():
    session = ProcessSession("rearl_jax.timing.decision_steps:decision_steps", name=DETECTION, **SCENE)
    try:
        run = session.measure(BATCH, 2)
        assert session.facts["unit"] == BATCH
        assert session.facts["compile_s"] > 0
    finally:
        session.close()
    assert (run.n_scenarios, run.seconds) == (BATCH, SECONDS)

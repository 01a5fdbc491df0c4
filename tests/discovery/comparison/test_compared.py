"""Car-following models compared on drivers whose model is known: their own is chosen."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from rearl_jax.config.driver import record_of
from rearl_jax.discovery.comparison import comparison as module
from rearl_jax.discovery.comparison.compared import MOST_FITTED
from rearl_jax.discovery.comparison.comparison import BASE_TABLE, base_block, comparison_of
from rearl_jax.discovery.comparison.dependence import (
    better_model,
    dependent_effects,
    effects_in_other_models,
    with_doubts,
)
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import new_state, replaced
from rearl_jax.discovery.observe.noise import USUAL
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.reading import measure
from rearl_jax.discovery.read.split import split_drivers
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.outcome import Round, Search
from rearl_jax.discovery.search.simulated_drives import simulate_again
from rearl_jax.results import Study

NAMES = ("idm", "constant_time_headway")
PRIORS = [prior_of(record_of(name)()) for name in NAMES]
GAIN = Term("approach_rate_gain")
PUSH = Term("leader_acceleration")


@pytest.fixture(scope="module")
def driven_by(tables_of):
    """Drivers of different parameters who drive by a model, with noise, behind measured leaders, in three parts."""

    def drive(name, **pushed):
        data = measure(tables_of())
        solver = solver_of(data, prior_of(record_of(name)()))
        state = new_state(data, solver.layout, USUAL)
        state.z = np.random.default_rng(5).normal(size=state.z.shape)
        if pushed:
            values = {f"{PUSH.effect}.{key}": value for key, value in pushed.items()}
            state = replace(state, theta=solver.layout.with_values(state.theta, values), active=(PUSH,))
        again = simulate_again(solver, state, USUAL, np.random.default_rng(6)).data
        return Parts("generated", True, (), [], *split_drivers(again, seed=1), notes=())

    return drive


def silence(done, total):
    """No progress is shown."""


@pytest.fixture(scope="module")
def compared(driven_by, tmp_path_factory):
    """The drivers of a model, the models compared on them, and the study that keeps the choice."""

    @functools.cache
    def compare(name):
        config = DiscoverTask(
            results=ResultsConfig(str(tmp_path_factory.mktemp(name))), data=DataConfig(DataFormat.table, "nowhere")
        )
        study = Study(config.results.root, "killed", config, "discover", "generated", generated=True)
        parts = driven_by(name)
        return parts, comparison_of(PRIORS, parts, config.discover, silence, study), study

    return compare


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("idm", marks=pytest.mark.thorough), "constant_time_headway"])
def test_drivers_keep_the_model_they_drive_by(compared, name):
    parts, found, _ = compared(name)
    assert found.prior.name == name
    block = base_block(found, DiscoverConfig(), {})
    assert (block["chosen"], block["driver"], block["differs"]) == (name, "idm", name != "idm")
    usual, other = block["compared"]
    assert usual["gain"] == {"value": 0.0, "low": 0.0, "high": 0.0}
    assert usual["protocols"]["population"]["n_drivers"] == parts.checked.n_drivers
    assert usual["protocols"]["other_runs"] is None  # nobody is known from two runs
    gain = other["gain"]
    assert gain["low"] < gain["value"] < gain["high"]
    assert gain["low"] > 0 if name == other["name"] else gain["value"] < 0
    assert usual["best_share"] + other["best_share"] == pytest.approx(1.0)
    if name == "idm":
        # Calibrated once: the search begins with it.
        assert found.base is not None
        assert found.base.fit.state.data is parts.fitted
    else:
        assert found.base is None


@pytest.mark.slow
def test_a_killed_run_makes_the_same_choice_without_comparing_again(compared, monkeypatch):
    (parts, first, study), options = compared("constant_time_headway"), DiscoverConfig()
    assert study.owns(BASE_TABLE)
    monkeypatch.setattr(module, "compared_models", None)
    again = comparison_of(PRIORS, parts, options, silence, study)
    assert again.prior == first.prior
    assert base_block(again, options, {}) == base_block(first, options, {})
    assert again.rivals == first.rivals


def test_of_many_drivers_some_are_calibrated(driven_by):
    data = driven_by("idm").fitted
    assert data.sample(MOST_FITTED, 0) is data
    few = data.sample(2, 0)
    assert few.n_drivers == 2 < data.n_drivers


@pytest.mark.slow
def test_what_another_model_has_by_itself_depends_on_the_model(driven_by):
    """Drivers of constant time headway who answer to their leader's acceleration, calibrated by IDM."""
    parts = driven_by("constant_time_headway", gain=0.6)
    outcome = _found_under_idm(parts, PUSH, GAIN)
    solver = solver_of(parts.fitted, PRIORS[0])
    others = effects_in_other_models(solver, outcome, PRIORS[1:], parts.fitted)
    assert dependent_effects(outcome, others) == {PUSH: (), GAIN: ("constant_time_headway",)}
    better = better_model(others, 0)
    assert better is not None
    assert better.name == "constant_time_headway"  # which they drive by
    assert with_doubts(outcome, others, 0).of_model == {GAIN}, "which the more likely model does without"
    as_likely = [replace(one, gains=np.zeros_like(one.gains)) for one in others]
    assert with_doubts(outcome, as_likely, 0).of_model == {GAIN}
    worse = [replace(one, gains=-np.abs(one.gains)) for one in others]
    assert better_model(worse, 0) is None
    assert with_doubts(outcome, worse, 0).of_model == frozenset()
    hardly_better = [replace(one, gains=np.full_like(one.gains, 1e-3)) for one in others]
    assert better_model(hardly_better, 0) == others[0].prior, "one effect fewer"
    with_both = [replace(one, holds=dict.fromkeys(one.holds, True)) for one in hardly_better]
    assert better_model(with_both, 0) is None
    nothing = replace(outcome, rounds=[replace(outcome.rounds[0], accepted=[])])
    assert effects_in_other_models(solver, nothing, PRIORS[1:], parts.fitted) == []
    assert better_model([], 0) is None


def _found_under_idm(parts, *terms):
    """A search that has added some effects, one after the other."""
    solver = solver_of(parts.fitted, PRIORS[0])
    fit, rounds = base_of(solver, parts.fitted).fit, []
    for term in terms:
        state = replaced(fit.state, active=(*fit.state.active, term))
        solver.solve([state], iterations=15, tolerance=0.1)
        candidate = solver.layout.candidates[term]
        after = Fit(candidate, state, fit.noise)
        nothing = np.zeros(parts.fitted.n_drivers)
        trial = Trial(candidate, after, nothing, nothing, state, 0.0)
        rounds.append(Round(fit, {}, {}, {}, frozenset(), [trial], [trial]))
        fit = after
    assert fit.state.theta[list(solver.layout.candidates[GAIN].directions)] > 0.03  # IDM lacks it
    return Search(solver.layout, Null(dict.fromkeys(terms, 0.0), {}, 1), {}, parts.checked, rounds=rounds)

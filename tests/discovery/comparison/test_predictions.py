"""Additions to a model that are kept only if they predict other drivers."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.comparison import predictions
from rearl_jax.discovery.comparison.predictions import (
    clocks_predict_better,
    is_significantly_better,
    predicting_effects,
    predicting_variation,
)
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.clocks import Clocks
from rearl_jax.discovery.read.training import halves
from rearl_jax.discovery.report.protocols import ProtocolErrors
from rearl_jax.discovery.search import procedure
from rearl_jax.discovery.search.clock_check import ClockCheck
from rearl_jax.discovery.search.headway import CONSTANT_TIME_GAP, START_SHARES, TimeGapVariation
from rearl_jax.discovery.search.simulated_drives import simulate_again
from tests.discovery.search.searches import search_that_added

ADDED = (("reaction_delay", [0.7, 0.0]), ("approach_rate_gain", [0.5]), ("grade", [1.0]))


DRIVERS = np.linspace(0.5, 1.5, 12)


def quiet(*_):
    """Progress that nobody sees."""


def no_null(*_):
    """Nulls of a search that makes no rounds of its own."""
    raise AssertionError


def told(monkeypatch, errors):
    """Makes the mean gap error of each model the one in `errors` of its last added candidate [m]."""
    monkeypatch.setattr(predictions, "recalibrated", lambda solver, data, fit: fit.state)

    def predicted(solver, state, fit, **_):
        name = "" if fit.candidate is None else fit.candidate.term.effect
        error, drivers = {"gap_rmse": errors[name] * DRIVERS}, np.arange(len(DRIVERS))
        return {"population": ProtocolErrors(drivers, error, error, 0), "first_half": None, "other_runs": None}

    monkeypatch.setattr(predictions, "prediction_errors", predicted)


def names_of(trials):
    return [trial.candidate.term.effect for trial in trials]


def test_additions_stay_if_each_predicts_better(solver, calibrated, monkeypatch):
    found = search_that_added(solver, calibrated, *ADDED)
    told(monkeypatch, {"": 2.0, "reaction_delay": 1.8, "approach_rate_gain": 1.7, "grade": 1.6})
    assert predicting_effects(solver, found, 0, no_null, quiet) is found


def test_the_next_best_candidate_takes_the_place_of_one_that_predicts_no_better(solver, calibrated, monkeypatch):
    found = search_that_added(solver, calibrated, *ADDED)
    (grade,) = search_that_added(solver, calibrated, ADDED[2]).added
    first = replace(found.rounds[0], accepted=[found.added[0], grade])
    found = replace(found, rounds=[first, *found.rounds[1:]])
    told(monkeypatch, {"": 2.0, "reaction_delay": 2.01, "grade": 1.8})
    later = []

    def next_round(solver, base, screen, outcome, report):
        later.append((names_of(outcome.added), outcome.excluded))
        return replace(found.rounds[-1], base=base)

    monkeypatch.setattr(procedure, "_screen", lambda *_: None)
    monkeypatch.setattr(procedure, "_round", next_round)
    left = predicting_effects(solver, found, 0, no_null, quiet)
    assert names_of(left.added) == ["grade"]
    assert names_of(left.rejected) == ["reaction_delay"]
    assert later == [(["grade"], frozenset({Term("reaction_delay")}))]
    assert left.unpredictive == {Term("reaction_delay")}
    assert left.is_contradicted
    assert "reaction_delay" not in names_of(left.rounds[0].possible), "it is no rival of what took its place"


def test_without_a_candidate_that_predicts_better_none_stays(solver, calibrated, monkeypatch):
    found = search_that_added(solver, calibrated, *ADDED)
    told(monkeypatch, {"": 2.0, "reaction_delay": 2.01})
    left = predicting_effects(solver, found, 0, no_null, quiet)
    assert not left.added
    assert names_of(left.rejected) == ["reaction_delay"]
    assert len(left.rounds) == 1


def test_a_response_to_the_vehicle_behind_cannot_show_that_it_predicts(solver, calibrated, monkeypatch):
    found = search_that_added(solver, calibrated, ("rear_pressure", 0.3))
    told(monkeypatch, {"": 2.0, "rear_pressure": 1.5})
    left = predicting_effects(solver, found, 0, no_null, quiet)
    assert not left.added
    assert left.unpredictive == {Term("rear_pressure")}


@pytest.mark.parametrize("lasts", [True, False])
def test_clocks_stay_corrected_only_if_the_first_half_tells_the_second(solver, calibrated, several, lasts):
    found, (state, noise) = search_that_added(solver, calibrated), several
    measured = simulate_again(solver, state, noise, np.random.default_rng(3)).data
    assert clocks_predict_better(solver, found, measured, 0), "nothing was corrected"
    clocks = Clocks(measured)
    late = clocks.corrected(0.5 * np.random.default_rng(4).standard_normal(clocks.values.shape))
    is_late = lasts | (halves(measured).training.weight > 0)
    of_leaders = {
        name: np.where(is_late, getattr(late.surroundings, name), getattr(measured.surroundings, name))
        for name in ("leader_rear", "leader_speed")
    }
    late = replace(measured, surroundings=replace(measured.surroundings, **of_leaders))
    corrected = replace(found, clocks=ClockCheck(found.first, 1.0, 1.0, 0.3, late, late))
    assert clocks_predict_better(solver, corrected, late, 0) is lasts


def test_of_use_is_what_surely_predicts_better_and_nowhere_worse():
    before = {"population": 2.0 * DRIVERS, "first_half": DRIVERS}
    noise = 0.8 * np.cos(np.arange(len(DRIVERS)))
    surely, hardly, worse = 1.8 * DRIVERS, 2.0 * DRIVERS + noise - noise.mean() - 0.02, 2.1 * DRIVERS
    assert is_significantly_better(before, {"population": surely, "first_half": 0.99 * DRIVERS}, seed=1)
    assert not is_significantly_better(before, {"population": hardly, "first_half": DRIVERS - 1e-3 * noise}, seed=1)
    assert not is_significantly_better(before, {"population": surely, "first_half": 1.05 * DRIVERS}, seed=1)
    assert not is_significantly_better(before, {"population": worse, "first_half": 0.9 * DRIVERS}, seed=1)
    assert not is_significantly_better({}, {}, seed=1)


@pytest.mark.parametrize(
    ("with_start", "kept"),
    [
        ({0.9: 1.5}, 0.9),
        ({0.9: 1.999, 0.7: 1.999, 0.4: 1.999}, 0.0),
        ({0.9: 2.2, 0.7: 2.1, 0.4: 1.6}, 0.4),
        ({0.9: 2.2, 0.7: 2.1, 0.4: 2.05}, 0.0),
    ],
)
def test_the_start_of_a_drive_is_used_as_far_as_it_predicts_others(solver, calibrated, monkeypatch, with_start, kept):
    found = search_that_added(solver, calibrated)
    monkeypatch.setattr(predictions, "recalibrated", lambda solver, data, fit: fit.state)

    class Variations:
        def __init__(self, *_):
            pass

        def best(self, start_shares=START_SHARES):
            return TimeGapVariation(sd=0.3, start_share=max(start_shares))

    def predicted(*_, variation=CONSTANT_TIME_GAP):
        error = with_start.get(variation.start_share, 2.0) * DRIVERS + 0.1 * np.cos(3 * DRIVERS)
        if variation.start_share:
            error += 0.2 * np.sin(40 * DRIVERS)
        of_all = ProtocolErrors(np.arange(len(DRIVERS)), {"gap_rmse": error}, {}, 0)
        return {"population": of_all, "first_half": None, "other_runs": None}

    monkeypatch.setattr(predictions, "VariationSearch", Variations)
    monkeypatch.setattr(predictions, "prediction_errors", predicted)
    variation = predicting_variation(solver, found, seed=0)
    assert variation.sd == 0.3
    assert variation.start_share == kept


@pytest.mark.slow
def test_a_delay_that_nobody_has_predicts_worse(solver, calibrated):
    found = search_that_added(solver, calibrated, ("reaction_delay", [1.2, 1.2]))
    left = predicting_effects(solver, found, 0, no_null, quiet)
    assert not left.added
    assert len(left.rejected) == 1

"""Additions to a model that are kept only as far as they predict other drivers."""

import numpy as np
import pytest

from rearl_jax.discovery.comparison import predictions
from rearl_jax.discovery.comparison.predictions import best_predicting, predict_surely_better, predicting_variation
from rearl_jax.discovery.report.protocols import ProtocolErrors
from rearl_jax.discovery.search.headway import TimeGapVariation
from tests.discovery.search.searches import search_that_added

ADDED = (("reaction_delay", [0.7, 0.0]), ("approach_rate_gain", [0.5]), ("grade", [1.0]))


DRIVERS = np.linspace(0.5, 1.5, 12)


@pytest.mark.parametrize(
    ("errors", "kept"), [((2.0, 1.8, 1.9, 1.7), 3), ((2.0, 1.8, 1.9, 1.85), 1), ((2.0, 2.1, 2.2, 2.01), 0)]
)
def test_as_many_additions_stay_as_predict_best(solver, calibrated, monkeypatch, errors, kept):
    found = search_that_added(solver, calibrated, *ADDED)
    assert len(found.added) == 3
    told = iter(errors)
    monkeypatch.setattr(predictions, "recalibrated", lambda solver, data, fits: [fit.state for fit in fits])

    def predicted(*_, **__):
        error, drivers = {"gap_rmse": next(told) * DRIVERS}, np.arange(len(DRIVERS))
        return {"population": ProtocolErrors(drivers, error, error, 0), "first_half": None, "other_runs": None}

    monkeypatch.setattr(predictions, "prediction_errors", predicted)
    left = best_predicting(solver, found, seed=0)
    assert [trial.candidate for trial in left.added] == [trial.candidate for trial in found.added[:kept]]
    assert [trial.candidate for trial in left.rejected] == [trial.candidate for trial in found.added[kept:]]
    assert left.is_contradicted == (kept < 3)


def test_of_use_is_what_surely_predicts_better_and_nowhere_worse():
    before = {"population": 2.0 * DRIVERS, "first_half": DRIVERS}
    noise = 0.8 * np.cos(np.arange(len(DRIVERS)))
    surely, hardly, worse = 1.8 * DRIVERS, 2.0 * DRIVERS + noise - noise.mean() - 0.02, 2.1 * DRIVERS
    assert predict_surely_better(before, {"population": surely, "first_half": 0.99 * DRIVERS}, seed=1)
    assert not predict_surely_better(before, {"population": hardly, "first_half": DRIVERS - 1e-3 * noise}, seed=1)
    assert not predict_surely_better(before, {"population": surely, "first_half": 1.05 * DRIVERS}, seed=1)
    assert not predict_surely_better(before, {"population": worse, "first_half": 0.9 * DRIVERS}, seed=1)
    assert not predict_surely_better({}, {}, seed=1)


@pytest.mark.parametrize(("with_start", "kept"), [(1.5, 0.7), (1.999, 0.0), (2.1, 0.0)])
def test_the_start_of_a_drive_is_used_only_where_it_predicts_others(solver, calibrated, monkeypatch, with_start, kept):
    found = search_that_added(solver, calibrated)
    monkeypatch.setattr(predictions, "recalibrated", lambda solver, data, fits: [fit.state for fit in fits])

    def estimated(solver, fit, seed, start_shares=(0.0, 0.7)):
        return TimeGapVariation(sd=0.3, start_share=max(start_shares))

    def predicted(*_, variation):
        error = (with_start if variation.start_share else 2.0) * DRIVERS + 0.1 * np.cos(3 * DRIVERS)
        if variation.start_share:
            error += 0.2 * np.sin(40 * DRIVERS)
        of_all = ProtocolErrors(np.arange(len(DRIVERS)), {"gap_rmse": error}, {}, 0)
        return {"population": of_all, "first_half": None, "other_runs": None}

    monkeypatch.setattr(predictions, "time_gap_variation", estimated)
    monkeypatch.setattr(predictions, "prediction_errors", predicted)
    variation = predicting_variation(solver, found, seed=0)
    assert variation.sd == 0.3
    assert variation.start_share == kept


@pytest.mark.slow
def test_a_delay_that_nobody_has_predicts_worse(solver, calibrated):
    found = search_that_added(solver, calibrated, ("reaction_delay", [1.2, 1.2]))
    left = best_predicting(solver, found, seed=0)
    assert not left.added
    assert len(left.rejected) == 1
    assert best_predicting(solver, left, seed=0) is left

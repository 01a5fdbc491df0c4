"""What was found stays only as far as it predicts other drivers."""

import numpy as np
import pytest

from rearl_jax.discovery.comparison import predictions
from rearl_jax.discovery.comparison.predictions import best_predicting, predict_surely_better
from rearl_jax.discovery.report.protocols import ProtocolErrors
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
    monkeypatch.setattr(predictions, "recalibrated", lambda solver, data, fits: fits)

    def predicted(*_):
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


@pytest.mark.slow
def test_a_delay_that_nobody_has_predicts_worse(solver, calibrated):
    found = search_that_added(solver, calibrated, ("reaction_delay", [1.2, 1.2]))
    left = best_predicting(solver, found, seed=0)
    assert not left.added
    assert len(left.rejected) == 1
    assert best_predicting(solver, left, seed=0) is left

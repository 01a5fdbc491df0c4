"""Tests whether a search explains the drivers, and whether one with another model does better."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.search.explanation import Prediction, is_explained, predicts_better
from tests.discovery.search.searches import ADEQUATE, search_that_added

DELAY = ("reaction_delay", [0.4, 0.0])
CURVE = ("dependence.speed", 0.1)

INADEQUATE = replace(ADEQUATE, autocorrelation=0.5)


def test_names_and_nothing_account_for_drivers_where_noise_alone_is_left(solver, calibrated):
    for added in ((), (DELAY,)):
        found = search_that_added(solver, calibrated, *added)
        assert is_explained(found, ADEQUATE)
        assert not is_explained(found, INADEQUATE)


def test_a_curve_a_doubt_or_what_was_taken_back_accounts_for_nothing(solver, calibrated):
    named, curve = (search_that_added(solver, calibrated, one) for one in (DELAY, CURVE))
    last = named.rounds[-1]
    rival = replace(named.rounds[0].accepted[0], penalty=-100.0)
    beaten = replace(
        named.rounds[0], trials=[*named.rounds[0].trials, rival], exceeding=frozenset({rival.candidate.term})
    )
    for found in (
        curve,
        replace(named, rounds=[beaten, last]),
        replace(curve, rounds=[last], rejected=curve.added),
        replace(named, rounds=[replace(last, clock_z_score=9.0)]),
        replace(named, rounds=[replace(last, z_score={rival.candidate.term: 9.0})]),
    ):
        assert not is_explained(found, ADEQUATE)


@pytest.mark.parametrize(
    ("gain", "error", "expected"), [(99.0, 0.9, True), (-99.0, 0.9, False), (99.0, 1.005, True), (99.0, 1.1, False)]
)
def test_another_model_is_preferred_where_it_surely_predicts_better(calibrated, gain, error, expected):
    data = calibrated[0].data
    n = data.n_drivers
    before, after = Prediction(np.zeros(n), np.ones(n), data), Prediction(np.full(n, gain / n), np.full(n, error), data)
    assert predicts_better(before, after, 0) is expected
    uneven = np.where(np.arange(n) == 0, 1.5 * n, -1.0) * np.sign(gain)
    assert (uneven.sum() > 0) == (gain > 0)
    unsure = replace(after, log_likelihood=uneven, gap_error=np.ones(n))
    assert not predicts_better(before, unsure, 0), "one driver decides"


def test_a_search_is_named_by_effects_of_drivers_or_roads_alone(solver, calibrated):
    named, curve, nothing = (search_that_added(solver, calibrated, *added) for added in ((DELAY,), (CURVE,), ()))
    turn = named.rounds[0]
    artefact = replace(turn.accepted[0], candidate=replace(turn.accepted[0].candidate, kind="artefact"))
    distorted = replace(named, rounds=[replace(turn, accepted=[artefact]), *named.rounds[1:]])
    assert [found.is_named for found in (named, curve, nothing, distorted)] == [True, False, False, False]

"""Whether a search accounts for the drivers, and whether one beside another model does better."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rearl_jax.discovery.search import explanation
from rearl_jax.discovery.search.explanation import is_explained, names_more
from tests.discovery.search.searches import search_that_added

DELAY = ("reaction_delay", [0.4, 0.0])
CURVE = ("dependence.speed", 0.1)


@pytest.fixture
def noise_alone(monkeypatch):
    """Sets whether what a search leaves is noise alone."""

    def set_to(is_enough):
        monkeypatch.setattr(explanation, "adequacy", lambda *_: SimpleNamespace(is_enough=is_enough))

    set_to(True)
    return set_to


def test_names_and_nothing_account_for_drivers_where_noise_alone_is_left(solver, calibrated, noise_alone):
    for added in ((), (DELAY,)):
        found = search_that_added(solver, calibrated, *added)
        noise_alone(True)
        assert is_explained(solver, found, 0)
        noise_alone(False)
        assert not is_explained(solver, found, 0)


def test_a_curve_a_doubt_or_what_was_taken_back_accounts_for_nothing(solver, calibrated, noise_alone):
    named, curve = (search_that_added(solver, calibrated, one) for one in (DELAY, CURVE))
    last = named.rounds[-1]
    rival = replace(named.rounds[0].accepted[0], price=-100.0)
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
        assert not is_explained(solver, found, 0)


@pytest.mark.parametrize(
    ("gain", "error", "expected"), [(99.0, 0.9, True), (-99.0, 0.9, False), (99.0, 1.005, True), (99.0, 1.1, False)]
)
def test_names_are_preferred_where_they_predict_as_well(
    solver, calibrated, noise_alone, monkeypatch, gain, error, expected
):
    curve, named = (search_that_added(solver, calibrated, one) for one in (CURVE, DELAY))
    n = calibrated[0].data.n_drivers
    # The model with the curve is asked first, in both comparisons.
    states = iter(
        [SimpleNamespace(marginal=lambda: np.zeros(n)), SimpleNamespace(marginal=lambda: np.full(n, gain / n))]
    )
    errors = iter([np.ones(n), np.full(n, error)])
    monkeypatch.setattr(explanation, "on_others", lambda *_: [next(states)])
    monkeypatch.setattr(explanation, "gap_errors", lambda *_: [next(errors)])
    assert names_more(solver, curve, solver, named, 0) is expected


def test_another_search_without_names_is_not_preferred(solver, calibrated, noise_alone):
    curve, nothing = search_that_added(solver, calibrated, CURVE), search_that_added(solver, calibrated)
    assert not names_more(solver, curve, solver, nothing, 0)
    assert not names_more(solver, nothing, solver, curve, 0)

"""Simulations of other drivers: gap errors compared, and additions removed that make them worse."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.base import Base
from rearl_jax.discovery.observe.candidates import LENS
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.resampling import resamples
from rearl_jax.discovery.search import simulation
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.procedure import search
from rearl_jax.discovery.search.simulation import DRAWS, confirmed, makes_simulations_worse, share_worse
from tests.discovery.search.searches import search_that_added


def search_with(solver, calibrated, delay):
    """A search that has added a reaction delay, right or wrong."""
    return search_that_added(solver, calibrated, ("reaction_delay", [delay, delay]))


def test_an_addition_that_makes_simulations_worse_is_taken_back(solver, calibrated):
    found = search_with(solver, calibrated, 1.2)
    assert found.added
    kept = confirmed(solver, found, 0)
    assert not kept.added
    assert kept.rejected == found.added
    assert kept.last is found.first


def test_what_simulations_contradict_is_no_rival_of_an_effect(solver, calibrated):
    found = search_with(solver, calibrated, 0.4)
    (other,) = search_that_added(solver, calibrated, ("leader_class", 0.3)).added
    first = found.rounds[0]
    for contradicted, expected in (([], 2), ([other], 1)):
        turn = replace(first, trials=[*first.trials, other], contradicted=contradicted)
        ((trial, rivals, _),) = replace(found, rounds=[turn, *found.rounds[1:]]).fitted_trials(np.zeros((2, 2)))
        assert trial is first.chosen
        assert len(rivals) == expected


def test_an_addition_that_does_nothing_is_left_alone(solver, calibrated):
    found = search_with(solver, calibrated, 0.0)
    assert confirmed(solver, found, 0) is found


@pytest.mark.parametrize(
    ("later", "errors", "kept"),
    [
        ("dependence.speed", (1.0, 0.5, 0.8), 1),
        ("dependence.speed", (1.0, 0.5, 0.5), 2),
        ("leader_acceleration", (1.0, 0.5, 0.8), 2),  # no free curve: it need only be better than nothing added
        ("leader_acceleration", (1.0, 0.5, 1.5), 1),
        ("leader_class", (1.0, 1.5, 1.4), 0),
    ],
)
def test_a_later_addition_that_makes_simulations_worse_goes_alone(solver, calibrated, monkeypatch, later, errors, kept):
    found = search_that_added(solver, calibrated, ("reaction_delay", [0.0, 0.0]), (later, 0.0))
    monkeypatch.setattr(simulation, "gap_errors", lambda *_: [np.full(10, error) for error in errors])
    left = confirmed(solver, found, 0)
    assert left.added == found.added[:kept]
    assert left.rejected == found.added[kept:]
    assert left.last.state is [found.first.state, *(trial.fit.state for trial in found.added)][kept]


@pytest.mark.parametrize(("size", "is_worse"), [(0.0, False), (12.0, True)])
def test_a_distortion_that_makes_simulations_worse_is_not_believed(solver, calibrated, size, is_worse):
    wave = np.cos(np.arange(len(solver.layout.candidates[LENS].free)))
    found = search_that_added(solver, calibrated, ("lens", size * wave))
    states = [recalibrated(solver, found.checked, fit) for fit in (found.first, found.last)]
    assert makes_simulations_worse(solver, *states) == is_worse


@pytest.mark.parametrize(("shift", "is_worse"), [(0.0, False), (8.0, True)])
def test_clocks_that_make_simulations_worse_are_not_believed(solver, calibrated, shift, is_worse):
    fit, data = Fit(None, *calibrated), calibrated[0].data
    late = replace(data, surroundings=replace(data.surroundings, leader_rear=data.surroundings.leader_rear + shift))
    states = [recalibrated(solver, drives, fit) for drives in (data, late)]
    assert makes_simulations_worse(solver, *states) == is_worse


@pytest.mark.slow
def test_the_round_is_repeated_without_a_distortion_that_simulations_deny(solver, calibrated, monkeypatch):
    found = search_that_added(solver, calibrated, ("lens", 0.0))
    turns, excluded = [found.rounds[0], replace(found.rounds[0], accepted=[])], []

    def round_of(solver, base, screen, outcome, report):
        excluded.append(outcome.excluded)
        return turns[len(excluded) - 1]

    module = "rearl_jax.discovery.search.procedure"
    monkeypatch.setattr(f"{module}._round", round_of)
    monkeypatch.setattr(simulation, "makes_simulations_worse", lambda *_: True)
    monkeypatch.setattr(f"{module}.clock_evidence", lambda *_: -1e9)
    null = Null({CLOCK_OFFSET: 0.0}, {CLOCK_OFFSET: 1.0}, 1)
    fitted = Base(found.first)
    outcome = search(solver, found.checked, found.checked, lambda *_: null, lambda *_: None, calibrated=fitted)
    assert excluded == [frozenset(), frozenset({LENS})]
    assert not outcome.added


def test_growth_is_relative_to_the_error_of_the_same_resample():
    before = np.array([1.0] * 9 + [12.0])
    after = before * np.sqrt([1.03] * 9 + [1.015])
    # Without the driver with the large error it grows by 3 %, with one of it or more by less than 2 %.
    without = (resamples(10, DRAWS, 0) < 9).all(axis=1).mean()
    assert share_worse(before, after, tolerated=0.02) == pytest.approx(without)
    assert share_worse(before, after) == 1.0
    assert share_worse(before, before) == 0.0

"""What makes simulations of other drivers worse is not kept."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.candidates import LENS
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.search.clock_check import ClockCheck
from rearl_jax.discovery.search.confirmation import clocks_confirmed, confirmed, lens_confirmed
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
        ((trial, rivals, _),) = replace(found, rounds=[turn, *found.rounds[1:]]).fitted_trials(np.zeros(2))
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
    module = "rearl_jax.discovery.search.confirmation"
    monkeypatch.setattr(f"{module}.gap_errors", lambda *_: [np.full(10, error) for error in errors])
    left = confirmed(solver, found, 0)
    assert left.added == found.added[:kept]
    assert left.rejected == found.added[kept:]
    assert left.last.state is [found.first.state, *(trial.fit.state for trial in found.added)][kept]


def test_a_distortion_that_makes_simulations_worse_is_not_believed(solver, calibrated):
    assert lens_confirmed(solver, search_with(solver, calibrated, 1.2), 0)  # there is none
    wave = np.cos(np.arange(len(solver.layout.candidates[LENS].free)))
    assert lens_confirmed(solver, search_that_added(solver, calibrated, ("lens", 0.0 * wave)), 0)  # no worse
    assert not lens_confirmed(solver, search_that_added(solver, calibrated, ("lens", 12.0 * wave)), 0)


def test_clocks_that_make_simulations_worse_are_not_believed(solver, calibrated):
    data = calibrated[0].data
    check = ClockCheck(Fit(None, *calibrated), 9.0, 9.0, 0.3, data, data)
    found = replace(search_with(solver, calibrated, 0.0), clocks=check)
    late = replace(data, surroundings=replace(data.surroundings, leader_rear=data.surroundings.leader_rear + 8.0))
    assert not clocks_confirmed(solver, replace(found, checked=late), data, 0)
    assert clocks_confirmed(solver, found, data, 0)  # no worse
    assert clocks_confirmed(solver, replace(found, clocks=None), data, 0)

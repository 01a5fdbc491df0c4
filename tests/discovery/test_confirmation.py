"""What makes simulations of other drivers worse is not kept."""

from dataclasses import replace

import numpy as np

from rearl_jax.discovery.clock_check import ClockCheck
from rearl_jax.discovery.confirmation import clocks_confirmed, confirmed, lens_confirmed
from rearl_jax.discovery.null import Null
from rearl_jax.discovery.procedure import Round, Search
from rearl_jax.discovery.refit import Fit
from rearl_jax.discovery.solver import copied


def search_with(solver, calibrated, delay):
    """A search that has added a reaction delay, right or wrong."""
    return search_that_added(solver, calibrated, "reaction_delay", [delay])


def search_that_added(solver, calibrated, name, values):
    """A search that has added a candidate with some numbers."""
    from rearl_jax.discovery.decision import Trial

    world, noise = calibrated
    candidate = solver.layout.candidates[name]
    theta = world.theta.copy()
    theta[list(candidate.free)] = values
    changed = copied(world, theta=theta, active=(name,))
    solver.sums([changed])
    gains = world.penalised() * 0.0 + 10.0
    trial = Trial(candidate, Fit(candidate, changed, noise), gains, gains, 0.0)
    base = Round(Fit(None, world, noise), {}, {}, {}, frozenset(), [trial], [trial])
    return Search(solver.layout, Null({}, {}, 1), {}, world.data, None, [base, replace(base, base=trial.fit, held=[])])


def test_an_addition_that_makes_simulations_worse_is_taken_back(solver, calibrated):
    found = search_with(solver, calibrated, 1.2)
    assert found.added
    kept = confirmed(solver, found, 0)
    assert not kept.added
    assert kept.rejected == found.added
    assert kept.last is found.first


def test_an_addition_that_does_nothing_is_left_alone(solver, calibrated):
    found = search_with(solver, calibrated, 0.0)
    assert confirmed(solver, found, 0) is found


def test_a_distortion_that_makes_simulations_worse_is_not_believed(solver, calibrated):
    assert lens_confirmed(solver, search_with(solver, calibrated, 1.2), 0)  # there is none
    wave = np.cos(np.arange(len(solver.layout.candidates["lens"].free)))
    assert lens_confirmed(solver, search_that_added(solver, calibrated, "lens", 0.0 * wave), 0)  # no worse
    assert not lens_confirmed(solver, search_that_added(solver, calibrated, "lens", 12.0 * wave), 0)


def test_clocks_that_make_simulations_worse_are_not_believed(solver, calibrated):
    data = calibrated[0].data
    check = ClockCheck(Fit(None, *calibrated), 9.0, 9.0, 0.3, data, data)
    found = replace(search_with(solver, calibrated, 0.0), clocks=check)
    late = replace(data, around=replace(data.around, leader_rear=data.around.leader_rear + 8.0))
    assert not clocks_confirmed(solver, replace(found, checked=late), data, 0)
    assert clocks_confirmed(solver, found, data, 0)  # no worse
    assert clocks_confirmed(solver, replace(found, clocks=None), data, 0)

"""Time gaps that vary within a driver: found where they do, and not where they do not."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.closed_loop import simulated_error
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.read.lasting import lasting
from rearl_jax.discovery.read.training import halves
from rearl_jax.discovery.report.variation import entry_of, variation_section
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.discovery.search import headway
from rearl_jax.discovery.search.headway import (
    CONSTANT_TIME_GAP,
    TimeGapVariation,
    VariationSearch,
    departures,
    energy_scores,
    later_halves,
)
from rearl_jax.discovery.search.simulated_drives import behind_noisy_drive

QUIET = 0.05
"""Noise of the acceleration of drivers whose time gap varies [m/s^2]."""


def later(solver, data, fit):
    """Second halves of drives, which are long enough."""
    state = later_halves(solver, data, fit)
    assert state is not None
    return state


def driven(solver, drivers, noise, varied):
    """Drivers on drives that they made themselves, with a time gap that has varied so."""
    state, _ = drivers
    drives = replace(state, pieces=replace(state.pieces, varied=varied))
    y = state.data.y - behind_noisy_drive(solver, drives, noise, np.random.default_rng(5))
    data = replace(state.data, y=y, smooth=y, smooth_speed=np.gradient(y, state.data.dt, axis=0))
    return replaced(state, data=data, pieces=replace(state.pieces, y=y))


@pytest.fixture
def varying(solver, many):
    """Drivers whose time gap varies by a third over some seconds, taken for a noise that they do not have."""
    state, noise = many
    varied = lasting(0.35, 5.0, state.data.y.shape, state.data.dt, np.random.default_rng(4))
    other = driven(solver, many, replace(noise, acceleration=QUIET), varied)
    return Fit(None, other, replace(noise, acceleration=0.3))


@pytest.mark.slow
def test_a_time_gap_that_varies_is_found_and_scored_better(solver, varying):
    found = VariationSearch(solver, varying, 0).best()
    assert 0.15 <= found.sd <= 0.65
    halved = later(solver, varying.state.data, varying)
    scores = {
        name: energy_scores(solver, halved, varying, 1, one)
        for name, one in (("before", CONSTANT_TIME_GAP), ("constant", CONSTANT_TIME_GAP), ("varying", found))
    }
    block = entry_of(found, 1.3, scores, Resampling(0.95, 200, 0))
    change = block["energy_score"]["change_share"]
    assert change["low"] < change["value"] < -0.03
    assert block["time_gap"] == pytest.approx(1.3 * found.sd, rel=0.5)
    section = variation_section({"time_gap_variation": block})
    assert len(section.tables[0].rows) == 5
    assert not variation_section({}).tables
    nobody = entry_of(found, 1.3, dict.fromkeys(scores, np.empty(0)), Resampling(0.95, 200, 0))
    assert nobody["energy_score"] is None
    assert not variation_section({"time_gap_variation": nobody}).tables


@pytest.fixture
def slowly_varying(solver, many):
    """Drivers whose time gap varies by a third over a quarter of a minute, with hardly any other noise, and who
    keep it when their drives begin.
    """
    state, noise = many
    data, prior = state.data, solver.layout.prior
    varied = lasting(0.35, 15.0, data.y.shape, data.dt, np.random.default_rng(6))
    values = prior.values(state.z, state.truck)[data.driver]
    time_gap, jam_gap = (values[:, prior.names.index(name)] for name in ("time_gap", "jam_gap"))
    speed = state.pieces.start[1]
    front = data.surroundings.leader_rear[0] - jam_gap - speed * time_gap * np.exp(varied[0])
    follows = data.surroundings.has_leader[0] > 0
    start = np.stack([np.where(follows, front - data.length / 2, state.pieces.start[0]), speed])
    begun = replaced(state, pieces=replace(state.pieces, start=start))
    quiet = replace(noise, acceleration=QUIET)
    return Fit(None, driven(solver, (begun, noise), quiet, varied), quiet)


def test_the_gap_at_the_start_tells_where_the_variation_begins(solver, slowly_varying):
    state, prior = slowly_varying.state, solver.layout.prior
    told = TimeGapVariation(0.35, 15.0, start_share=0.9)

    def error(drivers, varied):
        drives = replaced(drivers, pieces=replace(drivers.pieces, varied=varied))
        return np.sqrt(drivers.data.driver_mean(simulated_error(solver, drives) ** 2))

    known, blind = error(state, told.expected(state, prior)), error(state, None)
    assert np.abs(departures(state, prior)).max() > 0.2
    assert known.mean() < 0.9 * blind.mean()
    unknown = replaced(state, z=state.mean[state.truck])
    assert error(unknown, told.expected_of_unknown(unknown, prior)).mean() < 0.9 * error(unknown, None).mean()
    assert replace(told, start_share=0.0).expected(state, prior) is None
    assert CONSTANT_TIME_GAP.expected_of_unknown(unknown, prior) is None


def test_realisations_begin_near_the_gap_at_the_start_and_forget_it(solver, slowly_varying):
    state, prior, rng = slowly_varying.state, solver.layout.prior, np.random.default_rng(0)
    told = TimeGapVariation(0.35, 3.0, start_share=0.75)
    drawn = np.stack([one for _ in range(400) if (one := told.drawn(state, prior, rng)) is not None])
    expected = told.expected(state, prior)
    assert expected is not None
    assert np.abs(expected[0]).max() > 0.2
    standard_error = 0.35 / np.sqrt(len(drawn))
    np.testing.assert_allclose(drawn.mean(axis=0)[[0, 20, -1]], expected[[0, 20, -1]], atol=5 * standard_error)
    np.testing.assert_allclose(drawn[:, 0].std(axis=0), 0.35 * np.sqrt(1 - 0.75), rtol=0.25)
    np.testing.assert_allclose(drawn[:, -1].std(axis=0), 0.35, rtol=0.25)


@pytest.mark.thorough
def test_drivers_who_only_accelerate_unevenly_keep_their_time_gap(solver, many):
    noise = replace(many[1], acceleration=0.3)
    other = driven(solver, many, noise, None)
    assert VariationSearch(solver, Fit(None, other, noise), 0).best().sd <= 0.15


@pytest.mark.slow
def test_drivers_who_are_quieter_than_assumed_keep_a_share_of_the_noise(solver, many, monkeypatch):
    """The share is identified where drivers' parameters are known: their errors in first halves would hide it."""
    monkeypatch.setattr(headway, "later_halves", lambda solver, data, fit: fit.state)
    noise = many[1]
    other = driven(solver, many, replace(noise, acceleration=QUIET), None)
    found = VariationSearch(solver, Fit(None, other, replace(noise, acceleration=0.3)), 0).best(())
    assert found.sd == 0
    assert found.noise_share in (0.0, 0.25), "the true share is a sixth"


def test_less_noise_and_no_variation_is_a_noisy_simulation_with_less_noise(solver, calibrated):
    state, noise = calibrated
    loud, quiet = (Fit(None, state, replace(noise, acceleration=sd)) for sd in (0.4, 0.2))
    halved = energy_scores(solver, state, loud, 3, TimeGapVariation(noise_share=0.5))
    np.testing.assert_allclose(halved, energy_scores(solver, state, quiet, 3), rtol=1e-5)
    assert np.abs(halved - energy_scores(solver, state, loud, 3)).max() > 1e-3


def test_a_second_half_has_no_influence_on_own_parameters(solver, calibrated):
    state, noise = calibrated
    fit, data = Fit(None, state, noise), state.data
    is_late = (data.weight > 0) & (halves(data).training.weight == 0)
    seen, unseen = (later(solver, one, fit) for one in (data, replace(data, y=data.y + 5.0 * is_late)))
    np.testing.assert_array_equal(seen.z, unseen.z)
    moved = (unseen.pieces.y - seen.pieces.y)[seen.data.weight > 0]
    np.testing.assert_allclose(moved, 5.0)
    early = later(solver, replace(data, y=data.y + 5.0 * ~is_late), fit)
    assert np.abs(early.z - seen.z).max() > 0.1

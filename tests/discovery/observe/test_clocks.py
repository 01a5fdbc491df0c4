"""Clocks that differ, planted in drives that were simulated from the calibrated model."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.clocks import Clocks, Pairs, main_leaders
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.search.clock_check import check_clocks, correct_shifts
from rearl_jax.discovery.thresholds import THRESHOLDS


def late(data, offset):
    """The data of drivers whose leaders' clocks are wrong."""
    account = Clocks(data)
    values = np.array([[offset[int(vehicle)] for vehicle in account.vehicle]])
    return account.corrected(-values), values[0]


@pytest.fixture
def chains(measured_of):
    data = measured_of()
    vehicles = np.unique(np.r_[data.vehicle, main_leaders(data)[main_leaders(data) >= 0]])
    offset = dict(zip(vehicles.tolist(), np.random.default_rng(4).normal(0, 0.4, len(vehicles)), strict=True))
    return late(data, offset)


@pytest.mark.slow
def test_clocks_are_put_right(solver, calibrated, chains):
    data, offset = chains
    base = Fit(None, *calibrated)
    account = Clocks(data)
    found = correct_shifts(solver, account, base)
    assert found.gain > 5
    leaders = main_leaders(data)
    own = data.driver_values(data.vehicle)
    place = {int(vehicle): k for k, vehicle in enumerate(account.vehicle)}
    pairs = [(place[int(own[k])], place[int(one)]) for k, names in enumerate(leaders) for one in names if one >= 0]
    ahead, seen = (
        [known[leader] - known[driver] for driver, leader in pairs] for known in (offset, found.estimate.values[0])
    )
    assert np.corrcoef(ahead, seen)[0, 1] > 0.7
    assert found.gain > correct_shifts(solver, Pairs(data), base).gain + THRESHOLDS.clock_lead


def test_clocks_that_are_right_are_left_alone(solver, calibrated, measured_of):
    base = Fit(None, *calibrated)
    assert correct_shifts(solver, Clocks(measured_of()), base).gain < 3
    assert check_clocks(solver, base, measured_of()) is None


def test_no_driver_decides_about_clocks(solver, calibrated, chains):
    data, _ = chains
    base = Fit(None, *calibrated)
    one = replace(data, weight=np.where(data.driver == 0, data.weight, 0.0))
    assert correct_shifts(solver, Pairs(one), base).gain < 12.0 + 1e-6

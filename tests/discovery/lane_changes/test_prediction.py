"""Predictions of held-out drivers: who is fitted, what is scored, and by what it is sorted."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.lane_changes.mobil import MobilRule
from rearl_jax.discovery.lane_changes.prediction import (
    BASE_RATE,
    CALIBRATED,
    LARGE_ADVANTAGE,
    LEAST_IN_PART,
    ORIGINAL,
    PREDICTORS,
    log_loss,
    prediction,
    seconds_at_risk,
)
from rearl_jax.discovery.report.lane_choice_scores import prediction_block
from rearl_jax.discovery.report.lane_choice_section import significantly_worse
from rearl_jax.discovery.resampling import Resampling
from tests.discovery.lane_changes.made import by_mobil, made


def predicted(table, hazard=None):
    part = table.vehicle % 3
    return prediction(table, part, np.full(len(part), 0.01) if hazard is None else hazard, 0.9, 900, 7)


@pytest.fixture(scope="module")
def found():
    return predicted(by_mobil(1))


def mean_loss(found, name):
    return log_loss(found.chance[name], found.table.changes).mean()


def test_only_held_out_drivers_are_scored(found):
    assert set(found.chance) == set(PREDICTORS)
    assert set(found.table.vehicle % 3) == {2}
    assert found.n_fitted_drivers == 400
    table = by_mobil(1)
    other = replace(table, changes=np.where(table.vehicle % 3 == 2, False, table.changes))
    other.changes[np.flatnonzero(table.vehicle % 3 == 2)[:LEAST_IN_PART]] = True
    for name, chance in predicted(other).chance.items():
        np.testing.assert_array_equal(chance, found.chance[name])


def test_calibrated_mobil_predicts_those_who_follow_it_and_the_usual_one_expects_too_many(found):
    assert mean_loss(found, CALIBRATED) < mean_loss(found, BASE_RATE) - 0.001
    assert mean_loss(found, ORIGINAL) > mean_loss(found, BASE_RATE) + 0.1
    made_changes = found.table.changes.sum()
    assert found.chance[CALIBRATED].sum() == pytest.approx(made_changes, rel=0.3)
    assert found.chance[ORIGINAL].sum() > 5 * made_changes


def test_the_constant_rate_is_that_of_each_side():
    table = by_mobil(1, bias=0.9)
    found = predicted(table)
    for side in (-1, 1):
        own = (table.side == side) & (table.vehicle % 3 < 2)
        chance = np.unique(found.chance[BASE_RATE][found.table.side == side])
        assert chance == pytest.approx(table.changes[own].mean(), rel=0.02)


def test_nothing_is_scored_for_a_few_changes():
    table = by_mobil(1)
    held = np.flatnonzero((table.vehicle % 3 == 2) & table.changes)
    few = table.changes.copy()
    few[held[LEAST_IN_PART - 1 :]] = False
    assert predicted(replace(table, changes=few)) is None
    few[held[LEAST_IN_PART - 1]] = True
    assert predicted(replace(table, changes=few)) is not None


def test_urgency_is_the_advantage_in_speed_or_a_ramp(found):
    faster = [-1.0, 0.0, 0.1, LARGE_ADVANTAGE, 9.0]
    table = made(5, side_leader_speed=faster, is_mandatory=[False, False, False, False, True])
    strata = replace(found, table=table).strata()
    expected = {"no_advantage": [0, 1], "small_advantage": [2], "large_advantage": [3], "mandatory": [4]}
    for name, rows in expected.items():
        assert np.flatnonzero(strata[name]).tolist() == rows
    assert np.flatnonzero(strata["right"]).tolist() == [1, 3]


def test_two_sides_of_one_moment_share_its_time():
    table = made(4, vehicle=[1, 1, 1, 2], frame=[0, 0, 5, 0])
    np.testing.assert_allclose(seconds_at_risk(table), [0.25, 0.25, 0.5, 0.5])


def test_losses_are_finite_if_an_opportunity_lasts_as_long_as_a_delay():
    table = by_mobil(1, n=6000, drivers=300)
    found = predicted(replace(table, period=np.full(len(table.side), MobilRule().delay)))
    assert all(np.isfinite(mean_loss(found, name)) for name in PREDICTORS)
    block = prediction_block(found, Resampling(0.9, 50, 0))
    assert block is not None
    assert ORIGINAL in significantly_worse(block)


def test_an_impossible_change_has_an_infinite_loss():
    loss = log_loss(np.array([0.0, 0.0, 0.5]), np.array([True, False, True]))
    np.testing.assert_allclose(loss, [np.inf, 0.0, np.log(2)])

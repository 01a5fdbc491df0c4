"""MOBIL as a choice: its rule by hand, and its parameters where they are known."""

import numpy as np
import pytest

from rearl_jax.config.mobil import MobilConfig
from rearl_jax.discovery.lane_changes.mobil import LONGEST_DELAY, MobilRule, calibrated_mobil
from rearl_jax.discovery.lane_changes.opportunities import PERIOD
from rearl_jax.discovery.lane_changes.prediction import seconds_at_risk
from tests.discovery.lane_changes.made import by_mobil, made


def test_the_usual_rule_is_that_of_the_keys():
    rule, keys = MobilRule(), MobilConfig()
    assert (rule.politeness, rule.gain_threshold) == (keys.politeness, keys.gain_threshold)
    assert (rule.safe_decel, rule.delay, rule.bias) == (keys.safe_decel, keys.delay, 0.0)


def test_the_rule_weighs_own_gain_others_side_and_safety():
    table = made(
        6,
        side=[-1, 1, 1, 1, 1, 1],
        incentive=[0.5, 0.5, 0.19, 0.2, 0.5, 0.5],
        rear_gain=[0.0, 0.0, 0.0, 0.0, -1.0, 0.0],
        follower_gain=[0.0, 0.0, 0.0, 0.0, 0.2, 0.0],
        rear_after=[0.0, 0.0, 0.0, 0.0, 0.0, -2.1],
    )
    assert MobilRule().accepts(table).tolist() == [True, True, False, True, True, False]
    assert MobilRule(politeness=0.5).accepts(table).tolist() == [True, True, False, True, False, False]
    assert MobilRule(bias=0.4).accepts(table).tolist() == [False, True, True, True, True, False]
    chance = MobilRule(delay=1.0, refused_chance=0.01).chance(table)
    np.testing.assert_allclose(chance, [PERIOD, PERIOD, 0.01, PERIOD, PERIOD, 0.01])


def test_the_delay_does_not_depend_on_the_period_of_the_opportunities():
    changes = np.arange(1000) % 20 == 0
    half, longer = (
        made(1000, incentive=np.ones(1000), changes=changes, period=np.full(1000, period)) for period in (0.5, 8 / 15)
    )
    delays = [MobilRule().with_rates(table).delay for table in (half, longer)]
    assert delays[1] / delays[0] == pytest.approx(16 / 15)
    np.testing.assert_allclose(MobilRule(delay=4.0).chance(longer), 2 / 15)
    assert seconds_at_risk(longer).sum() == pytest.approx(1000 * 8 / 15)


@pytest.mark.parametrize(("politeness", "bias"), [(0.0, 0.0), (0.5, 0.4)])
def test_known_parameters_are_found(politeness, bias):
    table = by_mobil(1, politeness=politeness, bias=bias)
    assert table.changes.sum() > 300
    found = calibrated_mobil(table, 0.9)
    rule = found.rule
    assert rule.politeness == pytest.approx(politeness, abs=0.11)
    assert rule.bias == pytest.approx(bias, abs=0.11)
    assert rule.gain_threshold == pytest.approx(0.6, abs=0.11)
    assert rule.safe_decel == 1.0
    assert rule.delay == pytest.approx(PERIOD / 0.05, rel=0.15)
    assert rule.refused_chance == pytest.approx(0.001, rel=0.5)
    for name, estimate in found.estimates.items():
        assert estimate.value == getattr(rule, name)
        if name != "delay":
            assert estimate.low is not None
            assert estimate.high is not None
            assert estimate.low <= estimate.value <= estimate.high


def test_what_data_do_not_tell_stays_as_usual():
    table = by_mobil(2, accepted=0.003, refused=0.003)  # nobody follows the rule
    rule, usual = calibrated_mobil(table, 0.9).rule, MobilRule()
    assert rule.politeness == pytest.approx(usual.politeness, abs=0.4)
    assert rule.gain_threshold == pytest.approx(usual.gain_threshold, abs=0.6)


def test_drivers_who_do_the_opposite_leave_the_usual_rule():
    table = made(2000, incentive=np.repeat([0.0, 1.0], 1000), changes=np.arange(2000) < 100, side=np.ones(2000, int))
    found = calibrated_mobil(table.take(np.arange(2000)), 0.9)
    assert found.rule.gain_threshold == MobilRule().gain_threshold
    assert found.rule.delay <= LONGEST_DELAY
    assert all(estimate.low is None for estimate in found.estimates.values())

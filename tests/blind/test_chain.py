"""The measurement chain whose parts are drawn."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.blind.traffic import Scenario
from rearl_jax.blind.traffic.chain import correlated, release, smoothed, weights
from rearl_jax.blind.traffic.population import USUAL
from rearl_jax.blind.traffic.priors import CHOICES
from rearl_jax.blind.traffic.scenario import Chain
from rearl_jax.blind.traffic.simulation import simulate

SCENARIO = Scenario(2, n_recordings=2, duration=20.0, lane_changes=6, position_noise=0.0, chain=Chain())


@pytest.fixture(scope="module")
def events():
    return simulate(SCENARIO)


def released(events, position_noise=0.0, **changes):
    return release(replace(SCENARIO, position_noise=position_noise), replace(Chain(), **changes), events)


def true(events, column, late_by=0.0):
    steps = np.searchsorted(events.time, np.arange(201) / 10 - late_by - 1e-6)
    return getattr(events, column)[steps]


@pytest.mark.parametrize("kernel", CHOICES["kernel"])
@pytest.mark.parametrize("deviation", [1.5, 4.0, 12.0])
def test_a_kernel_is_as_wide_as_asked(kernel, deviation):
    values = weights(kernel, deviation)
    place = np.arange(len(values)) - len(values) // 2
    assert values.sum() == pytest.approx(1.0)
    assert np.sqrt(np.sum(values * place**2)) == pytest.approx(deviation, rel=0.06)
    np.testing.assert_allclose(values, values[::-1])


def test_smoothing_keeps_straight_lines_and_lowers_noise():
    line = np.arange(200.0)[:, None]
    np.testing.assert_allclose(smoothed(line, "triangular", 5.0)[40:-40], line[40:-40])
    drawn = correlated((4000, 2), 0.0, 10.0, np.random.default_rng(1))
    assert smoothed(drawn, "gaussian", 5.0).std() < 0.4
    np.testing.assert_array_equal(smoothed(line, "none", 0.0), line)


def test_noise_is_correlated_as_asked():
    drawn = correlated((5000, 20), 0.5, 10.0, np.random.default_rng(1))
    assert drawn.std() == pytest.approx(1.0, rel=0.03)
    assert np.mean(drawn[5:] * drawn[:-5]) == pytest.approx(np.exp(-1.0), abs=0.04)


def test_positions_are_noisy_or_smooth(events):
    error = released(events, position_noise=0.2).position - true(events, "position")
    assert error.std() == pytest.approx(0.2, rel=0.05)
    smooth = released(events, kernel="gaussian", kernel_time=0.5)
    assert 0.0 < np.abs(smooth.position - true(events, "position")).max() < 1.0
    assert smooth.acceleration.std() < released(events).acceleration.std()


def test_speeds_come_from_positions_or_a_sensor(events):
    sensor = released(events, position_noise=0.5, speed="sensor", sensor_noise=0.1)
    from_positions = released(events, position_noise=0.5, slope_time=0.5)
    speed = true(events, "speed")
    moving = speed > 1.0
    assert (sensor.speed - speed)[moving].std() == pytest.approx(0.1, rel=0.05)
    assert (from_positions.speed - speed)[moving].std() > 0.3


def test_the_lane_column_follows_the_marking_or_the_decision(events):
    decided, crossed = (released(events, lane=lane, change_time=4.0) for lane in ("decision", "marking"))
    np.testing.assert_array_equal(decided.lane, true(events, "lane"))
    np.testing.assert_array_equal(crossed.lane, true(events, "lane", late_by=2.0))
    changed = np.argwhere(np.diff(crossed.lane, axis=0) != 0)
    assert len(changed) >= 6
    for frame, vehicle in changed:
        marking = 3.75 * max(crossed.lane[frame, vehicle], crossed.lane[frame + 1, vehicle])
        assert crossed.lateral[frame, vehicle] == pytest.approx(marking, abs=1.0)


@pytest.mark.parametrize("shape", ["normal", "uniform", "heavy_tails"])
def test_populations_are_correlated_and_as_wide_as_asked(shape):
    n = len(USUAL.parameters)
    correlation = 0.4 * np.ones((n, n)) + 0.6 * np.eye(n)
    drawn = replace(USUAL, shape=shape, correlation=tuple(map(tuple, correlation.tolist())))
    values = drawn.draw(np.zeros(20000, dtype=bool), 0.2, np.random.default_rng(1))
    logs = np.log([values[item.name] for item in drawn.parameters])
    for item, line in zip(drawn.parameters, logs, strict=True):
        assert np.median(line) == pytest.approx(np.log(item.median), abs=0.01)
        assert line.std() == pytest.approx(0.2 * item.sd, rel=0.05)
    assert np.corrcoef(logs)[0, 1] == pytest.approx(0.4, abs=0.05)

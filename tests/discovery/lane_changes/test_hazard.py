"""The logit and its score test on decisions drawn from a known chance."""

import numpy as np
import pytest

from rearl_jax.discovery.lane_changes.hazard import baseline, fit, knots, score_test
from rearl_jax.discovery.lane_changes.strengths import Choices, fit_incentive

N_DRIVERS, N_EACH = 150, 30


def draw(rng, strength=0.0, clustered=0.0):
    """Gains, an extra column that drivers share in part, decisions, drivers."""
    driver = np.repeat(np.arange(N_DRIVERS), N_EACH)
    gain = rng.normal(-0.5, 0.5, len(driver))
    extra = rng.normal(size=N_DRIVERS)[driver] * 0.5 + rng.normal(size=len(driver)) * 0.5
    own = clustered * rng.normal(size=N_DRIVERS)[driver]
    chance = 0.5 / (1 + np.exp(-(gain + strength * extra + own - 0.3) / 0.2))
    return gain, extra, rng.random(len(driver)) < chance, driver


def test_logit_recovers_its_coefficients_within_their_deviations():
    rng = np.random.default_rng(1)
    columns = np.column_stack([np.ones(20_000), rng.normal(size=(20_000, 2))])
    truth = np.array([-3.0, 1.0, -0.5])
    taken = rng.random(20_000) < 1 / (1 + np.exp(-columns @ truth))
    found = fit(columns, taken, np.arange(20_000))
    deviation = np.sqrt(np.diag(found.covariance))
    assert deviation.max() < 0.1
    assert np.all(np.abs(found.coefficients - truth) < 4 * deviation)


@pytest.mark.parametrize("clustered", [0.0, 0.2])
def test_score_test_is_calibrated_where_nothing_is_there(clustered):
    z = []
    for seed in range(300):
        gain, extra, taken, driver = draw(np.random.default_rng(seed), clustered=clustered)
        columns = baseline(gain, knots(gain, taken))
        model = fit(columns, taken, driver)
        z.append(score_test(model.coefficients, columns, taken, driver, extra))
    assert np.std(z) == pytest.approx(1.0, abs=0.13)
    assert np.mean(np.abs(z) > 1.96) < 0.09
    assert np.abs(z).max() < 4.0


def test_score_test_sees_what_is_there_with_its_sign():
    gain, extra, taken, driver = draw(np.random.default_rng(3), strength=-0.15)
    columns = baseline(gain, knots(gain, taken))
    model = fit(columns, taken, driver)
    assert taken.sum() > 100
    assert score_test(model.coefficients, columns, taken, driver, extra) < -4
    assert score_test(model.coefficients, columns, taken, driver, np.ones(len(gain))) == 0.0


@pytest.mark.parametrize("strength", [0.0, 0.15, 0.4])
def test_strength_is_found_in_units_of_the_incentive(strength):
    found, deviations = [], []
    for seed in range(8):
        gain, extra, taken, driver = draw(np.random.default_rng(seed), strength)
        data = Choices(gain, np.empty((len(gain), 0)), taken, driver)
        model = fit_incentive(data, extra[:, None], knots(gain, taken))
        found.append(model.strengths[0])
        deviations.append(np.sqrt(model.covariance[0, 0]))
    assert np.mean(found) == pytest.approx(strength, abs=0.02)
    assert np.std(found) < 2 * np.mean(deviations)


def test_saturation_is_not_taken_for_a_second_effect():
    """A strong effect bends where chances level off; tested along the curve, the bend is no finding."""
    rng = np.random.default_rng(5)
    driver = np.repeat(np.arange(400), 40)
    gain, side = rng.normal(0.0, 0.5, len(driver)), rng.choice([-1.0, 1.0], len(driver))
    taken = rng.random(len(driver)) < 0.5 / (1 + np.exp(-(gain + 0.35 * side - 0.3) / 0.15))
    data = Choices(gain, np.empty((len(gain), 0)), taken, driver)
    model = fit_incentive(data, side[:, None], knots(gain, taken))
    assert model.strengths[0] == pytest.approx(0.35, abs=0.02)
    unused = -np.where(side > 0, np.maximum(gain, 0), 0.0)
    slope = model.slope(data, side[:, None])
    columns = np.column_stack([model.columns(data, side[:, None]), slope * side])
    held = np.append(model.line.coefficients, 0.0)
    assert abs(score_test(held, columns, taken, driver, slope * unused)) < 3

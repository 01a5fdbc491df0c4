"""Energy score: its estimate written out, what it prefers, and what has none."""

import numpy as np
import pytest

from rearl_jax.metrics.energy import energy_score


def apart(one, other):
    """Euclidean distance in two dimensions, case by case."""
    return np.linalg.norm(one - other, axis=0)


def test_the_estimate_is_that_of_its_definition():
    rng = np.random.default_rng(0)
    samples, observed = rng.normal(size=(5, 2, 7)), rng.normal(size=(2, 7))
    expected = []
    for case in range(7):
        y, x = observed[:, case], samples[..., case]
        away = np.mean([np.hypot(*(one - y)) for one in x])
        pairs = [np.hypot(*(x[i] - x[j])) for i in range(5) for j in range(5) if i != j]
        expected.append(away - sum(pairs) / (2 * 5 * 4))
    np.testing.assert_allclose(energy_score(list(samples), observed, apart), expected)


def test_samples_equal_to_the_observation_score_zero_and_equal_samples_their_distance():
    observed = np.ones((2, 3))
    assert energy_score([observed] * 4, observed, apart).tolist() == [0.0] * 3
    moved = observed + np.array([[3.0], [4.0]])
    assert energy_score([moved] * 4, observed, apart).tolist() == [5.0] * 3


@pytest.mark.parametrize("n_samples", [2, 8])
def test_the_true_distribution_scores_best(n_samples):
    rng = np.random.default_rng(1)
    observed = rng.normal(size=(2, 20_000))
    drawn = rng.normal(size=(n_samples, 2, 20_000))
    score = {
        name: energy_score(list(samples), observed, apart).mean()
        for name, samples in (
            ("true", drawn),
            ("shifted", drawn + 0.5),
            ("narrow", 0.5 * drawn),
            ("wide", 1.6 * drawn),
            ("point", 0 * drawn),
        )
    }
    assert min(score, key=lambda name: score[name]) == "true"
    # The estimate is unbiased: E|X - X'| / 2 of the plane's normal distribution is sqrt(pi) / 2, whatever the number.
    assert score["true"] == pytest.approx(np.sqrt(np.pi) / 2, abs=0.02)


def test_a_single_sample_has_no_score_and_unknown_distances_do_not_count():
    rng = np.random.default_rng(2)
    samples, observed = list(rng.normal(size=(3, 2, 2))), rng.normal(size=(2, 2))
    assert np.isnan(energy_score(samples[:1], observed, apart)).all()
    samples[1] = samples[1] * [1.0, np.nan]
    found = energy_score(samples, observed, apart)
    assert found[0] == energy_score(samples, observed, apart)[0]
    assert found[1] == pytest.approx(energy_score(samples[::2], observed, apart)[1])
    assert np.isnan(energy_score([samples[1], samples[1]], observed, apart)[1])

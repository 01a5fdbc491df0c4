"""Mixtures of drivers who are known with errors of their own: kinds that are there are found, and no others."""

import numpy as np
import pytest

from rearl_jax.discovery.compute import grouped
from rearl_jax.discovery.groups import kinds
from rearl_jax.discovery.groups.mixture import DriverLikelihoods, drawn_from, one_group, split_further

SIZE = 4


@pytest.fixture(autouse=True)
def few_replicates(monkeypatch):
    """The fewest replicates with which a probability can be below the threshold."""
    monkeypatch.setattr(kinds, "REPLICATES", 19)


def _likelihoods(numbers: np.ndarray, deviation: np.ndarray, rng: np.random.Generator) -> DriverLikelihoods:
    """Drivers whose numbers are known with these standard deviations."""
    information = np.zeros((*numbers.shape, SIZE))
    information[:, range(SIZE), range(SIZE)] = deviation**-2.0
    return DriverLikelihoods(information, (numbers + deviation * rng.standard_normal(numbers.shape)) * deviation**-2.0)


def _drivers(n: int, apart: float, seed: int, precise: float = 0.3) -> tuple[DriverLikelihoods, np.ndarray]:
    """Two kinds, a third of the drivers the second, whose means are `apart` in two numbers; and who is of it."""
    rng = np.random.default_rng(seed)
    second = np.arange(n) % 3 == 0
    numbers = rng.standard_normal((n, SIZE))
    numbers[:, 1:3] += apart * second[:, None]
    return _likelihoods(numbers, precise * np.exp(0.3 * rng.standard_normal((n, SIZE))), rng), second


@pytest.mark.parametrize("seed", [0, 2])
def test_two_kinds_are_told_apart(seed):
    likelihoods, second = _drivers(90, 5.0, seed)
    found = kinds.kinds_of(likelihoods, seed)
    assert found.n == 2
    assert found.gain > 10
    assert found.chance <= 1 / (1 + kinds.REPLICATES)
    sure = np.array([kind is not None for kind in found.of_driver])
    assert sure.mean() > 0.95
    right = np.array([kind == 2 for kind in found.of_driver]) == second
    assert right[sure].mean() > 0.97


def test_numbers_in_which_kinds_do_not_differ_cost_nothing():
    likelihoods, _ = _drivers(90, 5.0, 1)
    two = split_further(likelihoods, one_group(likelihoods))
    assert set(two.differing) <= {1, 2}
    assert len(two.differing) > 0
    common = [place for place in range(SIZE) if place not in two.differing]
    np.testing.assert_allclose(two.mean[0, common], two.mean[1, common], atol=1e-9)


@pytest.mark.parametrize("n_seeds", [4, pytest.param(16, marks=pytest.mark.thorough)])
def test_one_kind_is_one_kind(n_seeds):
    """Normal, skewed and heavy-tailed populations; one may be taken for two."""
    several = 0
    for seed in range(n_seeds):
        rng = np.random.default_rng([7, seed])
        numbers = rng.standard_normal((60, SIZE))
        if seed % 4 == 1:
            numbers[:, 0] = rng.gamma(2.0, 0.7, 60)
        if seed % 4 == 2:
            numbers = numbers / np.sqrt(rng.chisquare(6, (60, 1)) / 6)
        several += kinds.kinds_of(_likelihoods(numbers, 0.3 * np.ones((60, SIZE)), rng), seed).n > 1
    assert several <= 1


@pytest.mark.slow
def test_drivers_of_whom_nothing_is_known_do_not_count():
    likelihoods, second = _drivers(90, 5.0, 2)
    blind = DriverLikelihoods(np.zeros((60, SIZE, SIZE)), np.zeros((60, SIZE)))
    both = DriverLikelihoods(
        *(np.concatenate([getattr(likelihoods, name), getattr(blind, name)]) for name in ("information", "weighted"))
    )
    alone, found = split_further(likelihoods, one_group(likelihoods)), split_further(both, one_group(both))
    order = [np.argsort(one.share) for one in (alone, found)]
    np.testing.assert_allclose(found.mean[order[1]], alone.mean[order[0]], atol=0.6)
    np.testing.assert_allclose(found.member[90:], np.broadcast_to(found.share, (60, 2)), atol=0.05)
    # A third is of the one kind and two thirds of the other: nobody unknown is surely of either.
    assert kinds.kinds_of(both, 0).of_driver[90:] == [None] * 60


def test_drawn_drivers_are_like_those_they_are_drawn_from():
    likelihoods, _ = _drivers(900, 5.0, 3)
    mixture = one_group(likelihoods)
    drawn = one_group(drawn_from(likelihoods, mixture, np.random.default_rng(0)))
    np.testing.assert_allclose(drawn.mean, mixture.mean, atol=0.3)
    np.testing.assert_allclose(np.diagonal(drawn.covariance[0]), np.diagonal(mixture.covariance[0]), rtol=0.25)


def test_purity_is_measured_against_chance():
    of_driver, labels = [1] * 30 + [2] * 10 + [None], ["a"] * 28 + ["b"] * 12 + ["b"]
    found = kinds.purity(of_driver, labels, 0)
    assert found is not None
    assert found["value"] == pytest.approx(38 / 40)
    assert 0.7 <= found["by_chance"] < 0.75
    assert kinds.purity(of_driver, ["a"] * 41, 0) is None


def test_groups_too_small_are_left_out(measured_of):
    data = measured_of()
    names = ["many"] * 9 + ["few"] * 2 + [None]
    groups, left_out = grouped(data, names)
    assert {name: members.n_drivers for name, members in groups.items()} == {"many": 9}
    assert left_out == {"few": 2, "unknown": 1}

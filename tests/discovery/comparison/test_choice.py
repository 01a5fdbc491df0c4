"""The choice of a car-following model from what every model predicts of the same drivers."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.comparison.choice import choice_of, is_beaten
from rearl_jax.discovery.thresholds import THRESHOLDS

N = 30
ERROR = np.full(N, 4.0)


def chosen(gains, errors=()):
    every = [np.zeros(N), *gains]
    return choice_of(every, [*errors, *({} for _ in range(len(every) - len(errors)))], seed=1)


def errors_of(**factors):
    """Errors of models: by protocol, the factor of each model."""
    return [
        {name: factor * ERROR for name, factor in zip(factors, of_model, strict=True)}
        for of_model in zip(*factors.values(), strict=True)
    ]


def scattered(mean, seed=0):
    """Gains of the drivers that differ by more than their mean, which is exact."""
    away = 2.0 * np.random.default_rng(seed).normal(size=N)
    return mean + away - away.mean()


@pytest.mark.parametrize(("mean", "expected"), [(-2.0, 0), (0.0, 0), (0.3, 0), (2.0, 1)])
def test_the_usual_model_stays_unless_another_surely_is_more_likely(mean, expected):
    found = chosen([scattered(mean)])
    assert found.chosen == expected
    assert (found.better_share[1] >= THRESHOLDS.base_confidence) == (expected == 1)


def test_few_nats_are_not_enough_however_alike_the_drivers_are():
    sure = np.full(N, THRESHOLDS.least_base_gain / N)
    assert chosen([sure]).better_share[1] == 1.0
    assert chosen([sure]).chosen == 0
    assert chosen([1.1 * sure]).chosen == 1


def test_the_most_likely_of_those_that_surely_are_better_is_chosen_and_how_sure_that_is_is_told():
    found = chosen([scattered(2.0), scattered(2.6, seed=1), scattered(-1.0, seed=2)])
    assert found.chosen == 2
    assert sum(found.best_share) == pytest.approx(1.0)
    assert found.best_share[2] > found.best_share[1] > found.best_share[3] == 0.0


@pytest.mark.parametrize("protocol", ["population", "first_half", "other_runs", "in_sample"])
@pytest.mark.parametrize(("factor", "is_vetoed"), [(1.2, True), (1.04, False), (0.9, False)])
def test_simulations_speak_against_a_model_that_predicts_surely_worse_gaps(protocol, factor, is_vetoed):
    found = chosen([np.full(N, 3.0)], errors_of(**{protocol: (1.0, factor)}))
    is_vetoed = is_vetoed and protocol != "in_sample"  # which predicts nothing
    assert (1 in found.vetoed) == is_vetoed
    assert found.chosen == (0 if is_vetoed else 1)


def test_simulations_seldom_reject_one_of_five_equal_models_by_chance():
    n_drivers, n_studies, rejected = 16, 60, 0
    for study in range(n_studies):
        rng = np.random.default_rng(study)
        usual = rng.lognormal(1.5, 0.6, n_drivers)
        errors = [
            {name: usual * rng.lognormal(0.0, 0.5, n_drivers) for name in ("population", "other_runs")}
            for _ in range(5)
        ]
        rejected += 0 in choice_of([np.zeros(n_drivers)] * 5, errors, seed=0).vetoed
    assert rejected < 0.2 * n_studies


def test_the_next_one_is_chosen_where_the_most_likely_simulates_worse():
    found = chosen([np.full(N, 5.0), np.full(N, 3.0)], errors_of(population=(1.0, 1.3, 0.8)))
    assert found.vetoed >= {1}
    assert found.chosen == 2


@pytest.mark.parametrize(("first_half", "expected"), [(1.1, 1), (1.6, 0)])
def test_where_simulations_speak_against_the_first_too_the_better_in_the_mean_follows(first_half, expected):
    found = chosen([np.full(N, 5.0)], errors_of(population=(1.0, 0.8), first_half=(1.0, first_half)))
    assert found.vetoed == {0, 1}
    assert found.chosen == expected


def test_a_model_is_beaten_only_where_another_surely_is_more_likely():
    gains = [np.zeros(N), scattered(2.0), scattered(1.9)]
    assert [is_beaten(one, gains, seed=0) for one in gains] == [True, False, False]


@pytest.mark.parametrize(("mean", "expected"), [(0.0, 1), (-0.2, 1), (-2.0, 0)])
def test_a_model_that_simulations_reject_gives_way_to_one_as_likely_that_they_do_not_reject(mean, expected):
    found = chosen([scattered(mean)], errors_of(population=(1.3, 1.0)))
    assert found.vetoed == {0}
    assert found.chosen == expected


@pytest.mark.parametrize(("first_half", "expected"), [(1.0, 1), (0.9, 1), (1.02, 0)])
def test_one_that_is_only_as_likely_predicts_no_worse_under_any_protocol(first_half, expected):
    found = chosen([scattered(0.2)], errors_of(population=(1.3, 1.0), first_half=(1.0, first_half)))
    assert found.vetoed == {0}
    assert found.chosen == expected


@pytest.mark.parametrize(("mean", "expected"), [(1.0, 0), (4.0, 1)])
def test_one_that_probably_predicts_worse_must_be_more_likely_beyond_doubt(mean, expected):
    few = np.linspace(0.2, 1.8, 8) * 4.0
    errors = [{"other_runs": few}, {"other_runs": few + 4.0 * np.resize([1.1, -0.8], 8)}]
    found = chosen([scattered(mean)], errors)
    assert not found.vetoed
    assert found.better_share[1] >= THRESHOLDS.base_confidence
    assert found.chosen == expected
    assert chosen([scattered(mean)]).chosen == 1


@pytest.mark.parametrize(("first_half", "expected"), [(1.05, 1), (1.6, 0)])
def test_one_that_is_worse_in_one_protocol_replaces_the_first_if_that_is_rejected_in_another(first_half, expected):
    found = chosen([scattered(1.0)], errors_of(population=(1.4, 1.0), first_half=(1.0, first_half)))
    assert 0 in found.vetoed
    assert 0 in found.worse_than[1]
    assert found.chosen == expected


@pytest.mark.parametrize(
    ("factors", "denied"),
    [((1.0, 1.3, 1.0), {1}), ((1.3, 1.2, 1.0), set()), ((1.2, 1.3, 1.0), {1}), ((1.0, 1.0, 1.0), set())],
)
def test_a_vetoed_model_replaces_only_one_that_is_vetoed_and_predicts_worse(factors, denied):
    found = replace(chosen([np.zeros(N)] * 2, errors_of(population=factors)), chosen=0)
    assert {other for other in (1, 2) if found.denies(other)} == denied


@pytest.mark.parametrize(("factor", "expected"), [(1.08, True), (1.0, False)])
def test_one_that_probably_predicts_worse_replaces_no_other(factor, expected):
    scatter = 2.0 * np.resize([1.0, -1.0], N)
    found = chosen([np.zeros(N)], [{"population": ERROR}, {"population": factor * ERROR + scatter}])
    assert found.vetoed == frozenset()
    assert found.denies(1) is expected

"""Choosing among threshold pairs, and the table of all of them."""

import numpy as np
import pytest

from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.config.sweep import SweepConfig
from rearl_jax.evaluation.percentiles import BaseValues
from rearl_jax.sweep.pairs import base_score, choose, pair_table, scene_means, threshold_pairs
from tests.refusal import refused

EVAL = EvaluationConfig(resamples=2000)


def base():
    return BaseValues(np.arange(101.0), np.arange(101.0) * 2, np.arange(3))


def test_pairs_are_all_combinations_of_the_percentiles():
    pairs = threshold_pairs(SweepConfig(h_pct=(5.0, 30.0), m_pct=(10.0, 20.0)), base())
    assert [(pair.h_pct, pair.m_pct) for pair in pairs] == [(5, 10), (5, 20), (30, 10), (30, 20)]
    assert [(pair.threshold_h, pair.threshold_m) for pair in pairs] == [(5, 20), (5, 40), (30, 20), (30, 40)]
    assert pairs[0].name == "5 % / 10 %"


def test_a_clear_winner_is_told_apart_and_a_lucky_one_is_not():
    rng = np.random.default_rng(0)
    scene = rng.normal(0, 1.0, 15)  # hard scenes are hard for every pair
    h = scene + np.array([0.5, 0.2, 0.4])[:, None] + rng.normal(0, 0.02, (3, 15))
    clear = choose(h, np.zeros((3, 15)), EVAL)
    assert (clear.best, clear.runner_up) == (1, 2)
    assert clear.is_distinguishable
    assert clear.lead == pytest.approx(0.2, abs=0.03)
    assert clear.lead_low < clear.lead < clear.lead_high
    assert clear.win_share.tolist() == [0, 1, 0]
    noisy = scene + np.array([0.5, 0.45, 0.46])[:, None] + rng.normal(0, 0.5, (3, 15))
    lucky = choose(noisy, np.zeros((3, 15)), EVAL)
    assert not lucky.is_distinguishable
    assert lucky.win_share[lucky.best] < 0.95
    assert lucky.win_share.sum() == pytest.approx(1)


def test_both_figures_decide():
    h, mape = np.array([[0.1, 0.1], [0.2, 0.2]]), np.array([[0.5, 0.5], [0.1, 0.1]])
    assert choose(h, mape, EVAL).best == 1


def test_base_is_scored_on_the_scenes_of_the_pairs():
    h = np.array([[0.1, np.nan, 0.3], [0.2, 0.9, 0.4]])
    choice = choose(h, np.zeros((2, 3)), EVAL)
    assert choice.is_scored.tolist() == [True, False, True]
    # Over all three scenes base would look closer than the best pair.
    base_h = np.array([0.25, 0.0, 0.32])
    assert base_h.mean() < choice.score[choice.best] == pytest.approx(0.2)
    assert base_score(base_h, np.zeros(3), choice.is_scored) == pytest.approx(0.285)


def test_one_pair_is_its_own_runner_up():
    choice = choose(np.ones((1, 4)), np.ones((1, 4)), EVAL)
    assert (choice.best, choice.runner_up, choice.lead) == (0, 0, 0)
    assert not choice.is_distinguishable


def test_one_scene_tells_no_pairs_apart():
    choice = choose(np.array([[0.3], [0.4]]), np.full((2, 1), 0.2), EVAL)
    assert (choice.best, choice.lead) == (0, pytest.approx(0.1))
    assert (choice.lead_low, choice.lead_high) == (None, None)
    assert not choice.is_distinguishable


def test_scenes_without_a_figure_of_some_pair_do_not_decide():
    h = np.full((2, 12), 0.3)
    h[1] = 0.2
    h[0, :3] = np.nan  # where only the second pair has a figure, and a bad one
    h[1, :3] = 9.0
    choice = choose(h, np.zeros((2, 12)), EVAL)
    assert choice.best == 1
    assert choice.win_share.tolist() == [0.0, 1.0]
    np.testing.assert_allclose(choice.score, [0.3, 0.2])
    h[0] = np.nan
    with refused("no-figure"):
        choose(h, np.zeros((2, 12)), EVAL)


def test_means_over_runs_go_to_their_pair_and_scene():
    pair, scene = np.repeat([0, 1], 4), np.tile([4, 9], 4)
    values = np.array([1.0, 10, 3, np.nan, 5, 20, 7, np.nan])
    means = scene_means(values, pair, scene, np.array([4, 9]))
    np.testing.assert_array_equal(means, [[2, 10], [6, 20]])
    assert np.isnan(scene_means(np.full(8, np.nan), pair, scene, np.array([4, 9]))).all()


def test_table_has_a_row_per_pair_and_marks_the_best():
    pairs = threshold_pairs(SweepConfig(h_pct=(5.0,), m_pct=(10.0, 20.0)), base())
    h, mape = np.array([[0.4, 0.6], [0.1, 0.1]]), np.full((2, 2), 0.2)
    table = pair_table(pairs, {"h": h, "mape": mape}, choose(h, mape, EVAL))
    assert table["h"].tolist() == [0.5, 0.1]
    assert table["score"].tolist() == pytest.approx([0.7, 0.3])
    assert table["is_best"].tolist() == [False, True]
    assert table["m_pct"].tolist() == [10, 20]


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({"h_pct": ()}, "h_pct"),
        ({"m_pct": (5.0, 101.0)}, "m_pct"),
        ({"h_pct": (5.0, 5.0)}, "h_pct"),
    ],
)
def test_percentiles_are_checked(keys, key):
    with refused("out-of-range", key=key):
        SweepConfig(**keys).check()

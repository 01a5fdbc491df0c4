"""The paper's figures agree with each other and with what is inferred from them."""

import pytest

from rearl_jax.config.metrics import HistConfig
from rearl_jax.metrics.histograms import legacy_scale
from rearl_jax.study import published
from rearl_jax.study.table1_tables import PAPER_COLUMNS, paper_figure


def test_all_distances_lie_below_the_legacy_scale():
    scale = legacy_scale(HistConfig())
    assert scale == pytest.approx(0.385, abs=5e-4)
    assert all(row.h_legacy < scale for row in published.TABLE1.values())
    assert max(published.THRESHOLDS_H.values()) < scale


def test_numbers_of_values_are_scenes_times_runs_times_seconds():
    n_rollouts = published.N_THRESHOLD_SCENES * published.N_RUNS
    assert published.N_VALUES_H == n_rollouts * 56
    assert published.N_VALUES_MAPE == n_rollouts * 60


def test_percentiles_rise_and_the_best_pair_is_one_of_the_front():
    for thresholds in (published.THRESHOLDS_H, published.THRESHOLDS_MAPE):
        assert list(thresholds) == [5, 10, 20, 30]
        assert list(thresholds.values()) == sorted(thresholds.values())
    assert published.BEST_PAIR in published.PARETO_PAIRS


def test_figures_stand_under_the_metrics_they_can_be_held_against():
    assert {metric: paper_figure("base", metric) for metric in PAPER_COLUMNS} == {
        "h_legacy": 0.346,
        "mape_a": 0.8978,
        "thw": 7.67,
        "lcr": 0.0081,
    }
    assert paper_figure("base", "h") is None  # not on our scale
    assert paper_figure(None, "h_legacy") is None

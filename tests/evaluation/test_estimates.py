"""Means, spread and paired bootstrap intervals, against textbook values and brute force."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config.evaluation import EvaluationConfig, SeedScope
from rearl_jax.evaluation import estimates as module
from rearl_jax.evaluation.estimates import FEW_SCENES, bootstrap_over, estimates, intervals
from rearl_jax.evaluation.scores import Scores


@pytest.fixture
def eval_config():
    return EvaluationConfig(resamples=4000)


def scores(row, values, *, partner=None, pooled=None):
    """Scores of a metric h given as [scenes, runs]."""
    n_scenes, n_runs = values.shape
    scene, run = (index.ravel() for index in np.indices(values.shape))
    return Scores(
        row,
        10 * scene,  # held-out scenes 0, 10, 20 ... of a larger set
        run,
        {"h": values.ravel()},
        {"h": np.ones(values.size, np.int64)},
        partner=partner,
        pooled=pooled or {},
    )


def held_out(n_scenes):
    return 10 * np.arange(n_scenes)


def test_interval_of_a_mean_is_that_of_the_textbook(eval_config):
    values = np.random.default_rng(0).normal(3.0, 2.0, (400, 1))
    ((low, high),) = intervals(values, eval_config)
    half = 1.96 * values.std(ddof=1) / np.sqrt(len(values))
    assert low == pytest.approx(values.mean() - half, abs=0.1 * half)
    assert high == pytest.approx(values.mean() + half, abs=0.1 * half)


@pytest.mark.parametrize(("n_scenes", "is_covered"), [(FEW_SCENES // 4, False), (FEW_SCENES, True)])
def test_few_scenes_are_called_too_few_where_intervals_are_too_narrow(eval_config, n_scenes, is_covered):
    samples = np.random.default_rng(1).normal(size=(n_scenes, 1000))
    low, high = np.array(intervals(samples, eval_config)).T
    assert bool(((low < 0) & (high > 0)).mean() > 0.9) is is_covered
    phrase = bootstrap_over(n_scenes, "scored scenes", 0.95)
    assert phrase.startswith(f"95 % bootstrap over {n_scenes} scored scenes")
    assert phrase.endswith("too narrow with so few") is not is_covered


def test_wider_confidence_is_a_wider_interval(eval_config):
    values = np.random.default_rng(2).normal(size=(30, 1))
    widths = [np.diff(intervals(values, replace(eval_config, confidence=c))[0])[0] for c in (0.5, 0.8, 0.99)]
    assert widths == sorted(widths)
    assert widths[0] > 0


def test_missing_values_do_not_count(eval_config):
    values = np.full((20, 3), np.nan)
    values[:15, 0] = np.random.default_rng(3).normal(5.0, 1.0, 15)
    values[4, 1] = 7.0
    found = intervals(values, eval_config)
    assert 4.0 < found[0][0] < values[:15, 0].mean() < found[0][1] < 6.0
    assert found[1:] == [(None, None), (None, None)]


def test_blocks_of_resamples_do_not_matter(eval_config, monkeypatch):
    values = np.random.default_rng(4).normal(size=(25, 2))
    whole = intervals(values, eval_config)
    monkeypatch.setattr(module, "_MAX_WEIGHTS", 25 * 7)
    in_parts = intervals(values, eval_config)
    np.testing.assert_allclose(in_parts, whole, rtol=1e-12)


def test_value_and_spread(eval_config):
    values = np.random.default_rng(5).uniform(size=(6, 4))
    values[2, 1] = np.nan
    found = estimates([scores("base", values)], held_out(6), eval_config)["base", "h"]
    assert found.value == pytest.approx(np.nanmean(values, axis=1).mean())
    assert found.sd == pytest.approx(np.nanmean(values, axis=0).std(ddof=1))
    assert found.low < found.value < found.high
    assert found.n_scenes == 6
    assert found.compared_with is None  # there is no row to compare with


def test_pooled_figure_replaces_the_mean_over_runs_but_not_the_spread(eval_config):
    values = np.random.default_rng(6).uniform(size=(5, 3))
    row = scores("base", values, pooled={"h": np.full(5, 0.25)})
    found = estimates([row], held_out(5), eval_config)["base", "h"]
    assert (found.value, found.low, found.high) == (0.25, 0.25, 0.25)
    assert found.sd == pytest.approx(values.mean(axis=0).std(ddof=1))


def test_difference_is_paired_by_scene(eval_config):
    rng = np.random.default_rng(7)
    hardness = rng.normal(0.0, 1.0, (40, 1))  # what makes a scene hard for both rows
    other = hardness + rng.normal(0.0, 0.05, (40, 3))
    base = hardness + 0.2 + rng.normal(0.0, 0.05, (40, 3))
    rows = [scores("base", base), scores("real_vs_real", other)]
    found = estimates(rows, held_out(40), eval_config)
    ours, theirs = found["base", "h"], found["real_vs_real", "h"]
    assert ours.compared_with == "real_vs_real"
    assert ours.difference == pytest.approx(ours.value - theirs.value)
    assert ours.low < theirs.high  # the intervals of the rows overlap,
    assert ours.difference_low > 0.1  # that of the difference is far from 0
    assert ours.difference_high < 0.3
    assert theirs.difference is None


def test_one_run_has_no_spread_and_one_scene_no_interval(eval_config):
    found = estimates([scores("base", np.array([[0.5]]))], held_out(1), eval_config)["base", "h"]
    assert (found.value, found.sd, found.low, found.high) == (0.5, None, None, None)


def test_a_metric_without_any_figure_is_left_out(eval_config):
    assert not estimates([scores("base", np.full((3, 2), np.nan))], held_out(3), eval_config)


def test_equal_seeds_give_equal_intervals(eval_config):
    values = np.random.default_rng(8).normal(size=(12, 1))
    assert intervals(values, eval_config) == intervals(values, eval_config)
    assert intervals(values, eval_config) != intervals(values, replace(eval_config, seed=1))


def test_rollouts_that_serve_all_scenes_leave_nothing_to_resample(eval_config):
    rng = np.random.default_rng(9)
    of_scenes = {name: scores(name, rng.uniform(size=(8, 1))) for name in ("rearl", "base", "real", "real_vs_real")}
    thw = {"rearl": np.full(8, 2.0), "base": np.full(8, 1.5), "real": rng.uniform(size=8), "real_vs_real": np.ones(8)}
    rows = [replace(row, values=row.values | {"thw": thw[name]}) for name, row in of_scenes.items()]
    ends = ("low", "high", "difference_low", "difference_high", "less_base_low", "less_base_high")
    for scope, has_interval in ((SeedScope.run_x_scene, True), (SeedScope.run, False)):
        found = estimates(rows, held_out(8), replace(eval_config, seed_scope=scope))
        assert (found["rearl", "thw"].value, found["rearl", "thw"].less_base) == (2.0, 0.5)
        for end in ends:
            assert (getattr(found["rearl", "thw"], end) is not None) is has_interval
            assert getattr(found["rearl", "h"], end) is not None
        assert found["real", "thw"].low is not None

"""The search for k, l and iterations: takes up its trace, ends with the grid, prefers what is best."""

import logging
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.clustering import search as module
from rearl_jax.clustering.search import TRACE, Objective, _posterior, search, simplified_silhouette
from rearl_jax.config.clustering import BoConfig, KlConfig
from rearl_jax.results import Study
from tests.clustering.curves import grouped_curves

KL = KlConfig(l=4, sample=40, centre_points=12)
BO = BoConfig(n_calls=10, n_initial=5, share=0.5, k=(2, 3, 4), l=(3, 5), iterations=(1, 2))


def study(root, name="search"):
    return Study(root, name, BO, "cluster", "data")


@pytest.mark.thorough
def test_search_taken_up_equals_an_uninterrupted_one(tmp_path):
    curves, _ = grouped_curves(120)
    best, whole = search(curves, KL, BO, study(tmp_path, "whole"), "data")
    for stop in (3, 7):  # among the random rounds and after them
        interrupted = study(tmp_path, f"part{stop}")
        search(curves, KL, replace(BO, n_calls=stop), interrupted, "data")
        assert len(pd.read_parquet(interrupted.path / f"{TRACE}.parquet")) == stop
        resumed = search(curves, KL, BO, interrupted, "data")
        assert resumed[0] == best
        pd.testing.assert_frame_equal(resumed[1], whole)
    assert set(whole["chosen_by"]) - {"random"}
    assert whole["gain_ei"].iloc[-1] != 0
    cells = whole[["k", "l", "iterations"]].drop_duplicates()
    assert len(cells) == 10  # nothing is tried twice


def test_nothing_is_evaluated_again(tmp_path, monkeypatch):
    curves, _ = grouped_curves(120)
    bo = replace(BO, n_calls=6)
    first = module.search(curves, KL, bo, study(tmp_path), "data")
    monkeypatch.setattr(module.Objective, "__call__", lambda *cell: pytest.fail("evaluated again"))
    assert module.search(curves, KL, bo, study(tmp_path), "data")[0] == first[0]


@pytest.mark.parametrize("change", ["data", "damage"])
def test_trace_of_another_search_or_a_damaged_one_is_not_taken_up(tmp_path, caplog, change):
    curves, _ = grouped_curves(120)
    bo = replace(BO, n_calls=3)
    _, first = search(curves, KL, bo, study(tmp_path), "data")
    path = tmp_path / "search" / f"{TRACE}.parquet"
    if change == "damage":
        path.write_bytes(path.read_bytes()[:200])
    with caplog.at_level(logging.WARNING):
        _, again = search(curves, KL, bo, study(tmp_path), "data" if change == "damage" else "other data")
    assert "the search starts again" in caplog.text
    pd.testing.assert_frame_equal(again, first)


def test_search_ends_with_the_grid_and_finds_its_best():
    curves, _ = grouped_curves(120)
    steps = []
    best, trace = search(curves, KL, replace(BO, n_calls=500), progress=lambda *step: steps.append(step))
    assert len(trace) == 12
    assert steps[-1] == (12, 12)
    objective = Objective(curves, KL, BO)
    values = {(k, l, i): objective(k, l, i)[1] for k in BO.k for l in BO.l for i in BO.iterations}  # noqa: E741
    assert values[best.k, best.l, best.iterations] == max(values.values())
    assert best.k == 3  # three groups


def test_hedge_proposes_what_its_model_thinks_best():
    grid = np.array([(k, l, 1) for k in range(2, 9) for l in range(4, 25, 2)])  # noqa: E741
    truth = -((grid[:, 0] - 5.0) ** 2) / 9.0 + 0.01 * grid[:, 1]
    seen = np.random.default_rng(0).choice(len(grid), 25, replace=False)
    mean, deviation, best = _posterior(grid, seen, truth[seen])
    unseen = np.setdiff1d(np.arange(len(grid)), seen)
    assert np.corrcoef(mean[unseen], truth[unseen])[0, 1] > 0.95
    assert best == pytest.approx((truth[seen].max() - truth[seen].mean()) / truth[seen].std())
    assert deviation[seen].mean() < deviation[unseen].mean()


def test_silhouette_of_known_distances():
    assert simplified_silhouette(np.array([[1.0, 2.0], [4.0, 2.0], [5.0, 8.0]], np.float32)) == pytest.approx(0.375)
    assert simplified_silhouette(np.zeros((2, 3), np.float32)) == 0.0

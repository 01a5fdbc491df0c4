"""`rearl sweep thresholds` on the shipped recordings: files, figures, what is said."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from rearl_jax.config import ResultsConfig, SweepThresholdsTask
from rearl_jax.config.core import CoreConfig, InitConfig, InitialSource
from rearl_jax.config.data import DataConfig
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.config.scenes import BoundarySource, ScenesConfig
from rearl_jax.config.sweep import SweepConfig
from rearl_jax.sweep.task import run
from tests.refusal import refused

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    root = tmp_path_factory.mktemp("results")
    config = SweepThresholdsTask(
        results=ResultsConfig(root=str(root)),
        data=DataConfig(),
        eval=EvaluationConfig(n_runs=2, resamples=500),
        sweep=SweepConfig(h_pct=(5.0, 30.0), m_pct=(5.0, 20.0)),
        core=CoreConfig(collisions=False),
    )
    summary = run(config)
    assert summary["n_pairs"] == 4
    return root / "sweep_thresholds"


def test_every_pair_was_simulated_on_every_tuning_scene(study):
    runs, table = pd.read_parquet(study / "runs"), pd.read_parquet(study / "table3.parquet")
    base = runs[runs.h_pct.isna()]
    assert len(base) == 2 * runs.scene_id.nunique()
    assert not set(base.h) & set(runs.h[runs.h_pct.notna()])
    runs = runs[runs.h_pct.notna()]
    assert len(table) == 4
    per_pair = runs.groupby(["h_pct", "m_pct"]).size()
    assert per_pair.tolist() == [2 * runs.scene_id.nunique()] * 4
    assert table.threshold_h.nunique() == table.threshold_m.nunique() == 2
    means = runs.groupby(["h_pct", "m_pct"], sort=True)[["h", "mape_a"]].mean()
    assert means["h"].tolist() == pytest.approx(table.h.tolist(), abs=1e-6)
    assert means["mape_a"].tolist() == pytest.approx(table.mape.tolist(), abs=1e-6)
    assert runs.h.nunique() > runs.scene_id.nunique() * 2  # thresholds change the traffic


def test_thresholds_are_percentiles_of_the_values_written(study):
    values, table = pd.read_parquet(study / "base_values.parquet"), pd.read_parquet(study / "table3.parquet")
    h = values.value[values.cue == "h"]
    row = table[table.h_pct == 30].iloc[0]
    assert row.threshold_h == pytest.approx(h.quantile(0.3), abs=1e-6)


def test_summary_names_the_best_pair(study):
    summary, table = json.loads((study / "summary.json").read_text()), pd.read_parquet(study / "table3.parquet")
    best = table[table.is_best].iloc[0]
    assert best.score == table.score.min()
    assert (summary["best_h_pct"], summary["best_m_pct"]) == (best.h_pct, best.m_pct)
    assert summary["lead_low"] <= summary["lead"] <= summary["lead_high"]
    assert {"base_values.png", "pairs.png", "config.json"} <= {path.name for path in study.iterdir()}


MEASURED = SweepThresholdsTask(
    scenes=ScenesConfig(boundary=BoundarySource.measured),
    eval=EvaluationConfig(n_runs=1, resamples=100),
    sweep=SweepConfig(h_pct=(30.0,), m_pct=(20.0,)),
    core=CoreConfig(collisions=False),
)


def test_a_boundary_without_recorded_starts_is_refused_before_anything_is_read(tmp_path):
    with refused("out-of-range", key="init.source"):
        run(replace(MEASURED, init=InitConfig(InitialSource.seed), results=ResultsConfig(str(tmp_path))))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_pairs_are_tried_among_recorded_vehicles(tmp_path, study):
    run(replace(MEASURED, results=ResultsConfig(str(tmp_path))))
    runs, free = pd.read_parquet(tmp_path / "sweep_thresholds" / "runs"), pd.read_parquet(study / "runs")
    assert sorted(set(runs.scene_id)) == sorted(set(free.scene_id))
    around, alone = (table[table.h_pct.isna()].groupby("scene_id")["h"].mean() for table in (runs, free))
    assert around.notna().all()
    assert (around != alone).all()

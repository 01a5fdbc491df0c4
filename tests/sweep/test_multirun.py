"""Jobs of a multirun: the rows of the batch sweep, nothing compiled twice, killed and resumed, put together."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from jax import monitoring

from rearl_jax.config import EvaluateTask, ResultsConfig, SweepThresholdsTask
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.detection import DetectionConfig
from rearl_jax.config.evaluation import EvaluationConfig, Method, Subset
from rearl_jax.config.sweep import SweepConfig
from rearl_jax.evaluation import task
from rearl_jax.sweep.cells import Cell, cell_table, collect

pytestmark = pytest.mark.slow  # a minute of jobs

PAIRS = [(5.0, 5.0), (5.0, 30.0), (30.0, 5.0), (30.0, 30.0)]


def evaluate_task(root, **keys):
    return EvaluateTask(
        method=Method.rearl,
        results=ResultsConfig(root=str(root), resume=True),
        eval=EvaluationConfig(n_runs=2, resamples=200, subset=Subset.tuning),
        core=CoreConfig(collisions=False),
        **keys,
    )


def cell_names(pair):
    return {"detection.h_pct": f"{pair[0]:g}", "detection.m_pct": f"{pair[1]:g}"}


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Four jobs run one after the other as a multirun would; the programs compiled in each."""
    from rearl_jax.evaluation.task import run

    root = tmp_path_factory.mktemp("cells")
    compiled = []
    monitoring.register_event_duration_secs_listener(
        lambda event, seconds, **_: compiled[-1].append(seconds) if event.endswith("backend_compile_duration") else None
    )
    for pair in PAIRS:
        compiled.append([])
        name = "/".join(f"{key}={value}" for key, value in sorted(cell_names(pair).items()))
        detection = DetectionConfig(h_pct=pair[0], m_pct=pair[1])
        run(evaluate_task(root, study=f"pairs/{name}", detection=detection))
    numbers = [len(programs) for programs in compiled]
    compiled.append([])
    collect(evaluate_task(root, study="pairs"), [cell_names(pair) for pair in PAIRS])
    return root / "pairs", numbers


def test_nothing_is_compiled_after_the_first_job(cells):
    assert cells[1][0] > 0
    assert cells[1][1:] == [0, 0, 0]


def test_jobs_and_the_batch_sweep_have_the_same_rows(cells, tmp_path):
    from rearl_jax.sweep.task import run

    given = evaluate_task(tmp_path)
    sweep = SweepConfig(h_pct=(5.0, 30.0), m_pct=(5.0, 30.0))
    run(SweepThresholdsTask(results=given.results, eval=given.eval, core=given.core, sweep=sweep))
    batch = pd.read_parquet(tmp_path / "sweep_thresholds" / "runs").dropna(subset="h_pct")
    jobs = pd.read_parquet(cells[0] / "runs.parquet")
    jobs = jobs[jobs["method"] == "rearl"]
    assert len(batch) == len(jobs) == 4 * 2 * batch.scene_id.nunique()
    assert batch.h.nunique() > len(batch) / 4  # thresholds change the traffic
    for name in ("h", "mape_a", "mape_b", "mape_c", "thw", "lcr", "collisions", "spacing"):
        left, right = batch[name].to_numpy(np.float32), jobs[name].to_numpy(np.float32, na_value=np.nan)
        np.testing.assert_array_equal(left, right, err_msg=name)
    assert batch.scene_id.tolist() == jobs.scene_id.tolist()
    assert batch.h_pct.tolist() == [float(value) for value in jobs["detection.h_pct"]]


def test_cells_are_one_table(cells):
    folder = cells[0]
    table = pd.read_parquet(folder / "cells.parquet")
    assert table["cell"].nunique() == 4
    assert {"rearl", "base", "real_vs_real", "real", "noise_floor"} == set(table["method"])
    runs = pd.read_parquet(folder / "runs.parquet")
    mean = runs[(runs["method"] == "rearl") & (runs["cell"] == "h_pct=30, m_pct=5")]["h"].mean()
    found = table[(table["method"] == "rearl") & (table["cell"] == "h_pct=30, m_pct=5") & (table["metric"] == "h")]
    assert float(found["value"].iloc[0]) == pytest.approx(float(mean), abs=1e-6)
    summary = json.loads((folder / "summary.json").read_text())
    assert [row["cell"] for row in summary] == [f"h_pct={h:g}, m_pct={m:g}" for h, m in PAIRS]
    assert {"cells.png", "config.json"} <= {path.name for path in folder.iterdir()}


def test_keys_that_differ_in_their_group_alone_are_written_in_full(tmp_path):
    rows = pd.DataFrame({"method": ["real"], "metric": "h", "value": [0.5]})
    keys = {"kl.seed": "1", "eval.seed": "2", "mape.definition": "A"}
    assert Cell(keys, tmp_path, rows, []).name == "kl.seed=1, eval.seed=2, definition=A"


def test_a_swept_method_is_a_column_of_its_own(tmp_path):
    def cell(name):
        rows = pd.DataFrame({"method": [name, "real"], "metric": "h", "value": [0.5, 0.1]})
        return Cell({"method": name}, tmp_path, rows, [])

    table = cell_table([cell("base"), cell("ppo")])
    assert table["method"].tolist() == ["base", "real", "ppo", "real"]
    assert table["cell_method"].tolist() == ["base", "base", "ppo", "ppo"]


def test_a_finished_job_is_left_alone_and_a_changed_one_is_not(cells, monkeypatch):
    folder = cells[0]
    config = evaluate_task(folder.parent, study="pairs/detection.h_pct=5/detection.m_pct=5")
    config = replace(config, detection=DetectionConfig(h_pct=5.0, m_pct=5.0))
    before = (folder / "detection.h_pct=5" / "detection.m_pct=5" / "runs.parquet").stat().st_mtime_ns
    monkeypatch.setattr(task, "evaluate", lambda *_: pytest.fail("simulated again"))
    rows = task.run(config)["rows"]
    assert rows[0]["method"] == "rearl"
    assert (folder / "detection.h_pct=5" / "detection.m_pct=5" / "runs.parquet").stat().st_mtime_ns == before
    with pytest.raises(pytest.fail.Exception, match="simulated again"):
        task.run(replace(config, eval=replace(config.eval, seed=1)))

"""`rearl sweep scale` on the shipped recordings: how many rollouts, resumed or not, what is measured and said."""

import contextlib
import io
import json
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np
import pandas as pd
import pytest
from rich.progress import Progress

from rearl_jax.cli.composition import compose_task
from rearl_jax.config import EvaluateTask, ResultsConfig, SweepScaleTask
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.evaluation import EvaluationConfig, Method, SeedScope
from rearl_jax.config.scenes import BoundarySource, ScenesConfig
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.splits import split_scenes
from rearl_jax.document.terminal import text_of
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import scored_rollouts
from rearl_jax.results import Study, config_hash
from rearl_jax.sweep import parts, scale, scale_costs, scale_progress
from rearl_jax.sweep.scale import run
from rearl_jax.sweep.scale_costs import BatchCost, batch_sizes
from rearl_jax.sweep.scale_document import document_of
from rearl_jax.sweep.scale_progress import StreamLog
from rearl_jax.sweep.scale_results import ScaleResults
from rearl_jax.tasks import TASKS
from tests.refusal import refused

N_ROLLOUTS, PART = 304, 76
"""Five scenes 61 times, the last time four of them; in four parts."""

SCRIPT = """
import sys
from rearl_jax.cli import main
from rearl_jax.sweep import parts, scale_costs

parts.MAX_PART_ROLLOUTS, scale_costs.BATCHES = 2_000, (2_000,)
sys.exit(main())
"""


@dataclass(frozen=True)
class Done:
    config: object
    folder: Path
    summary: dict
    printed: str
    compiled: int


def measured(config):
    """The task run with small parts; what it said, and how many programs were compiled meanwhile."""
    compiled = []

    def listen(event, duration, **_):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(duration)

    printed = io.StringIO()
    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
            patch.setattr(parts, "MAX_PART_ROLLOUTS", PART)
            patch.setattr(scale_costs, "BATCHES", (PART,))
            patch.setattr(scale_costs, "MIN_TIME_S", 0.0)
            summary = scale.run(config)
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)
    folder = Path(config.results.root) / config.study
    assert json.loads((folder / "summary.json").read_text()).items() >= summary.items()
    return Done(config, folder, summary, printed.getvalue(), len(compiled))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    config = SweepScaleTask(
        results=ResultsConfig(root=str(tmp_path_factory.mktemp("whole"))),
        method=Method.base,
        n_rollouts=float(N_ROLLOUTS),
        core=CoreConfig(collisions=False),
    )
    return measured(config)


@pytest.fixture(scope="module")
def resumed(whole, tmp_path_factory):
    """The same study without its second and fourth part, and one file that is no part, gone on with."""
    root = tmp_path_factory.mktemp("resumed")
    folder = root / whole.config.study
    shutil.copytree(whole.folder, folder)
    for number in (1, 3):
        (folder / "runs" / f"part-{number:05d}.parquet").unlink()
    (folder / "summary.json").unlink()
    (folder / "runs" / ".part-00003.parquet.123.unfinished").write_bytes(b"half a file")
    return measured(replace(whole.config, results=replace(whole.config.results, root=str(root))))


def test_exactly_as_many_rollouts_as_asked_for_and_no_two_alike(whole):
    runs = pd.read_parquet(whole.folder / "runs")
    assert len(runs) == N_ROLLOUTS
    assert len(list((whole.folder / "runs").iterdir())) == whole.summary["n_parts"] == 4
    assert not runs.duplicated(["scene_id", "run"]).any()
    per_run = runs.groupby("run")["scene_id"].nunique()
    assert per_run.index.tolist() == list(range(61))
    assert per_run.tolist() == [5] * 60 + [4]
    # Figures of a whole minute's traffic: equal only for rollouts from equal initial states.
    figures = runs[["h", "spacing", "mape_a", "thw", "jerk_rms"]]
    assert not figures.duplicated().any()
    assert all(runs.dtypes.drop(["scene_id", "run"]) == np.float32)


def test_the_stream_holds_what_evaluate_simulates(whole):
    start = {"init": whole.config.init, "speed": whole.config.speed}
    config = EvaluateTask(core=whole.config.core, eval=EvaluationConfig(n_runs=16), **start)
    scenes = build_scenes(iterate_recordings(config.data), config)
    held_out = split_scenes(scenes, config.split).evaluation
    scores = scored_rollouts(Rollouts([Row(config)], scenes, held_out)[:PART], scenes, held_out)
    runs = pd.read_parquet(whole.folder / "runs")[:PART]
    np.testing.assert_array_equal(runs["scene_id"], scenes.scene_id[scores.scene])
    np.testing.assert_array_equal(runs["run"], scores.run)
    for name in ("h", "mape_a", "lcr"):
        np.testing.assert_array_equal(runs[name], scores.values[name].astype(np.float32))


def test_a_study_that_lacks_parts_goes_on_and_equals_an_uninterrupted_one(whole, resumed):
    pd.testing.assert_frame_equal(pd.read_parquet(whole.folder / "runs"), pd.read_parquet(resumed.folder / "runs"))
    for number, is_new in enumerate([False, True, False, True]):
        name = f"runs/part-{number:05d}.parquet"
        same = (whole.folder / name).stat().st_mtime_ns == (resumed.folder / name).stat().st_mtime_ns
        assert same != is_new
    assert len(list((resumed.folder / "runs").iterdir())) == 4


def test_rates_of_a_resumed_study_count_what_was_simulated_now(whole, resumed):
    summary = resumed.summary
    assert summary["n_simulated"] == summary["n_before"] == 2 * PART
    assert summary["rollouts_per_s"] == pytest.approx(2 * PART / summary["wall_s"])
    assert summary["substeps_per_s"] == pytest.approx(2 * PART * 10 * 60 * 15 / summary["wall_s"])
    assert f"{summary['n_before']} rollouts were on disk before and do not count for the rates" in resumed.printed
    assert "on disk before" not in whole.printed


def test_memory_is_noted_part_by_part_and_sessions_are_told_apart(whole, resumed):
    table = pd.read_parquet(whole.folder / "progress.parquet")
    assert table["part"].tolist() == [0, 1, 2, 3]
    assert table["rollouts"].iloc[-1] == N_ROLLOUTS
    assert table["seconds"].is_monotonic_increasing
    assert (table["peak_mib"] >= table["resident_mib"] - 1).all()
    assert whole.summary["resident_mib_last_part"] == table["resident_mib"].iloc[-1] > 100
    both = pd.read_parquet(resumed.folder / "progress.parquet")
    pd.testing.assert_frame_equal(both[both["session"] == 0], table)
    assert both["part"][both["session"] == 1].tolist() == [1, 3]
    assert both["rollouts"].iloc[-1] == N_ROLLOUTS


def test_no_part_compiles_anew(whole, resumed):
    assert whole.compiled > 0
    assert resumed.compiled == 0


def test_costs_are_of_batches_up_to_the_number_of_rollouts(whole):
    cost = pd.read_parquet(whole.folder / "cost.parquet")
    assert cost["n_rollouts"].tolist() == [PART]
    assert (cost["repetitions"] == scale_costs.MIN_REPETITIONS).all()
    assert (cost[["simulate_s", "simulate_cpu_s", "score_s", "score_cpu_s"]] > 0).all(axis=None)
    # The first call compiles.
    assert (cost["first_s"] > 5 * cost["n_rollouts"] * (cost["simulate_s"] + cost["score_s"])).all()
    assert whole.summary[f"simulate_s_n{PART}"] == cost["simulate_s"][0]


def test_batch_sizes_end_at_the_number_of_rollouts():
    assert batch_sizes(1) == [1]
    assert batch_sizes(303) == [1, 10, 100, 303]
    assert batch_sizes(1_000_000) == [1, 10, 100, 1_000, 10_000]


def test_a_finished_study_has_no_rates_and_says_so(whole):
    again = measured(whole.config)
    assert again.summary["n_simulated"] == 0
    assert again.summary["rollouts_per_s"] is None
    assert again.summary["peak_mib_last_part"] is None
    assert "nothing was simulated, so no rates" in again.printed
    left = measured(replace(whole.config, results=replace(whole.config.results, resume=True)))
    assert left.printed == ""


def test_generated_recordings_are_marked(whole, tmp_path):
    machine = {"cpu_model": "one", "cpu_cores": 2, "jax_version": "0"}
    stream = StreamLog(Study(tmp_path, "none", whole.config, "sweep scale"), 0, {})
    cost = BatchCost(1, 3, 1.0, 1e-3, 1e-3, 1e-3, 1e-3)
    results = ScaleResults(whole.config, 5, 60, (0.5, np.inf), [cost], stream, machine, None, True)
    assert "GENERATED" in text_of(document_of(results))
    assert results.summary()["threshold_h"] == 0.5
    assert results.summary()["threshold_m"] is None


def test_the_bar_shows_the_rate_of_what_is_simulated_now(monkeypatch):
    bar, now = Progress(disable=True), [0.0]
    monkeypatch.setattr(scale_progress.time, "perf_counter", lambda: now[0])
    advance = scale_progress.shown_with_rate(bar, "rollouts", [slice(0, 100), slice(300, 400)])
    for seconds, done, text in (
        (0.0, 100, "rollouts"),
        (10.0, 200, "rollouts, 10/s, 40 s left"),
        (20.0, 300, "rollouts, 10/s, 30 s left"),
        (20.0, 400, "rollouts, 10/s, 30 s left"),
        (300.0, 500, "rollouts, 1/s, 3 min left"),
    ):
        now[0] = seconds
        advance(done, 700)
        assert bar.tasks[0].description == text


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory of the moment is known on Linux alone")
def test_memory_does_not_grow_with_the_number_of_rollouts(tmp_path):
    """The metrics of the last fifteen parts take some 50 MiB; were they kept, it would be seen."""
    words = ["sweep", "scale", "method=base", "core.collisions=false", "n_rollouts=50000", f"results.root={tmp_path}"]
    subprocess.run([sys.executable, "-c", SCRIPT, *words], check=True, capture_output=True)
    table = pd.read_parquet(tmp_path / "sweep_scale" / "progress.parquet")
    assert len(table) == 25
    for name in ("resident_mib", "peak_mib"):
        assert table[name][-10:].max() - table[name][:10].max() < 40


def test_replayed_vehicles_around_drawn_starts_are_refused_before_anything_is_written(tmp_path):
    config = SweepScaleTask(results=ResultsConfig(str(tmp_path)), scenes=ScenesConfig(boundary=BoundarySource.measured))
    with refused("out-of-range", key="init.source"):
        run(config)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["1.5", "0", "-3", "1e99", "inf"])
def test_what_is_no_number_of_rollouts_is_refused(text):
    (task,) = (task for task in TASKS if task.words == "sweep scale")
    with refused("out-of-range", key="n_rollouts"):
        compose_task(task, [f"n_rollouts={text}"], None)


def test_the_number_of_rollouts_may_be_written_with_an_exponent():
    (task,) = (task for task in TASKS if task.words == "sweep scale")
    short, long = (compose_task(task, [f"n_rollouts={text}"], None) for text in ("1e6", "1000000"))
    assert short.n_rollouts == 1_000_000
    assert config_hash(short) == config_hash(long)


def test_rollouts_shared_by_all_scenes_are_refused(whole):
    with refused("out-of-range", key="eval.seed_scope"):
        run(replace(whole.config, eval=replace(whole.config.eval, seed_scope=SeedScope.run)))
    with refused("out-of-range", key="n_rollouts"):
        run(replace(whole.config, n_rollouts=0.5))

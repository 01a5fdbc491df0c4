"""Small closed loops, really measured; and the benchmark on sessions that only pretend to."""

import json
from contextlib import contextmanager, nullcontext

import jax
import numpy as np
import pandas as pd
import pytest

from benchmarks import loop as module
from benchmarks.loop import count_steps, measure_rollouts, run
from benchmarks.loop_programs import (
    FOLLOWING,
    LOOP_WITH_TWO,
    NEVER,
    TWO_EFFECTS,
    effect_programs,
    programs_of,
    rollouts,
    usual,
)
from benchmarks.options import LoopBenchmark, LoopOptions, LoopPolicy
from rearl_jax import results
from rearl_jax.config import ResultsConfig
from rearl_jax.core.effects import EFFECTS
from rearl_jax.problems import InvalidInputError
from rearl_jax.timing import decision_steps, turns
from rearl_jax.timing.decision_steps import BASE, DECISION, DETECTION, LOOP, PARTS
from rearl_jax.timing.measurement import Measurement

N_VEHICLES, SECONDS, BATCH = 4, 8, 4
SCENE = {
    "n_vehicles": N_VEHICLES,
    "density": 2.0,
    "seconds": SECONDS,
    "batch": BATCH,
    "references": {"seed": 0, "n_references": 15, "n_seconds": SECONDS, "n_vehicles": 10},
}


@pytest.fixture(scope="module")
def programs():
    return {name: rollouts(name, **SCENE) for name in (BASE, NEVER, "rank_quiet", "rank")}


def traffic(run):
    return run.n_scenarios, run.mean_speed, run.lane_changes, run.crashed


@pytest.mark.slow
def test_only_the_triggered_loop_changes_the_traffic_of_base(programs):
    runs = {name: program.measure(20 * BATCH, 5) for name, program in programs.items()}
    base = runs[BASE]
    assert base.lane_changes > 5
    assert base.n_substeps == 20 * BATCH * N_VEHICLES * SECONDS * 15
    assert traffic(runs[NEVER]) == traffic(runs["rank_quiet"]) == traffic(base)
    assert runs["rank"].mean_speed != base.mean_speed
    assert all(run.cpu_s > 0 for run in runs.values())
    assert traffic(programs[BASE].measure(20 * BATCH, 6)) != traffic(base)


@pytest.mark.slow
def test_asked_are_all_who_drive_or_nobody(programs):
    shares = {name: program.facts["asked_share"] for name, program in programs.items()}
    # The first second follows no decision.
    assert shares["rank"] == pytest.approx((SECONDS - 1) / SECONDS, abs=0.1)
    assert [shares[name] for name in (BASE, NEVER, "rank_quiet")] == [0, 0, 0]


@pytest.mark.slow
def test_the_compiler_leaves_out_the_policy_only_where_it_cannot_be_needed(programs):
    operations = {name: program._run.cost_analysis()["flops"] for name, program in programs.items()}
    assert operations[BASE] < operations[NEVER] < operations["rank_quiet"]
    # Thresholds that nothing passes save at most a branch or two.
    assert operations["rank_quiet"] > 0.9 * operations["rank"]


@pytest.mark.slow
def test_only_whole_batches_are_measured(programs):
    with pytest.raises(ValueError, match=r"10 is not a multiple of the batch of 4"):
        programs[BASE].measure(10, 0)


def test_unknown_programs_are_refused():
    with pytest.raises(ValueError, match="no program 'nothing'"):
        rollouts("nothing", **SCENE)


def test_every_effect_is_measured_unless_some_are_chosen():
    assert effect_programs(None) == (FOLLOWING, *EFFECTS, TWO_EFFECTS, LOOP_WITH_TWO)
    assert effect_programs(("grade",)) == (FOLLOWING, "grade", TWO_EFFECTS, LOOP_WITH_TWO)
    assert effect_programs(()) == ()
    with pytest.raises(InvalidInputError) as caught:
        effect_programs(("nothing",))
    assert (caught.value.code, caught.value.problem.key) == ("choice-unknown", "loop.effects")


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_is_on(name):
    effect = usual(name)
    strengths = [item for item in effect.parameters if item.is_strength]
    assert any((np.asarray(getattr(effect, item.name)) != item.off).any() for item in strengths)
    for item in effect.parameters:
        values = np.asarray(getattr(effect, item.name))
        assert ((values >= item.low) & (values <= item.high)).all() or name.endswith("dependence")


@pytest.mark.slow
def test_effects_change_the_traffic_and_the_loop_decides_in_it():
    names = (FOLLOWING, "reaction_delay", "acceleration_noise", "dependence", LOOP_WITH_TWO)
    with jax.enable_x64(False):  # as the task runs: an effect's numbers are of the type that arrays have by default
        programs = {name: rollouts(name, **SCENE) for name in names}
        runs = {name: program.measure(4 * BATCH, 5) for name, program in programs.items()}
    speeds = [run.mean_speed for run in runs.values()]
    assert len(set(speeds)) == len(names)
    assert all(5 < speed < 35 for speed in speeds)
    assert programs[LOOP_WITH_TWO].facts["asked_share"] > 0.5
    assert programs[FOLLOWING].facts["asked_share"] == 0


class Fake:
    """A program of constant speed that notes when it is asked."""

    def __init__(self, name, scene, log):
        self.name, self.scene, self.log = name, scene, log
        self.facts = {"unit": scene["batch"], "compile_s": 2.0, "asked_share": 0.5}
        self.cost = {BASE: 1.0, NEVER: 1.2, LOOP: 2.0, DETECTION: 0.1, DECISION: 0.3}.get(name, 1.5)

    def measure(self, n_scenarios, seed):
        self.log.append((self.name, n_scenarios, seed))
        cpu_s = 1e-3 * n_scenarios * self.scene["seconds"] * self.cost
        n_substeps = n_scenarios * self.scene["n_vehicles"] * self.scene["seconds"] * 15
        figures = {"n_scenarios": n_scenarios, "seconds": self.scene["seconds"], "n_substeps": n_substeps}
        return Measurement(**figures, cpu_s=cpu_s, wall_s=cpu_s, mean_speed=20.0, lane_changes=1, crashed=0)


@pytest.fixture
def log(monkeypatch):
    """Measurements requested of stand-ins that only pretend to measure."""
    noted = []

    @contextmanager
    def pretend(kind, names, scene, label, report):
        for name in names:
            report(f"{name}, compiled", 1)
        yield {name: Fake(name, scene, noted) for name in names}

    monkeypatch.setattr(module, "open_sessions", pretend)
    monkeypatch.setattr(decision_steps, "open_sessions", pretend)
    return noted


def test_all_programs_simulate_the_same_scenes(log):
    loop = LoopOptions(policies=(LoopPolicy.raw,), repetitions=2, seconds=10, repetition_cpu_s=0.5, seed=3)
    cell = measure_rollouts(loop, 10, 16, lambda doing, advance: None)
    names = [BASE, NEVER, "raw_quiet", "raw"]
    assert log[:4] == [(name, 16, 3) for name in names]
    # Base takes 0.16 s for a batch, so three fill half a second.
    assert log[4:] == [(name, 48, 4) for name in names] + [(name, 48, 5) for name in names[::-1]]
    assert cell.detection.median == pytest.approx(0.2)
    assert cell.policy(LoopPolicy.raw).median == pytest.approx(0.3)
    assert cell.ratio("raw").median == pytest.approx(1.5)


def test_benchmark_writes_everything_and_its_bar_ends_full(log, tmp_path, capsys, monkeypatch):
    bar = Bar()
    few = {"effects": ("grade",), "repetitions": 2, "rounds": 2, "steps_repetitions": 3}
    loop = LoopOptions(vehicles=(3, 5), batches=(1, 8), **few)
    task = LoopBenchmark(study="tiny", results=ResultsConfig(root=str(tmp_path)), loop=loop)
    monkeypatch.setattr(turns, "progress_bar", lambda: nullcontext(bar))
    summary = run(task)
    assert bar.advanced == count_steps(loop)
    folder = tmp_path / "tiny"
    written = json.loads((folder / "summary.json").read_text())
    assert summary.items() <= written.items()
    assert written["detection_share_n3_b8"] == pytest.approx(0.2)
    assert written["policy_share_idle_n5_b1_max"] == pytest.approx(0.3)
    assert written["loop_ratio_rank_n5_b8"] == pytest.approx(1.5)
    assert written["steps_ms_loop_n10_b256"] == pytest.approx(2 * 256 * 10)
    assert written["paper_ms_rearl"] == 86_241
    table = pd.read_parquet(folder / "bench_loop.parquet")
    n_programs = len(programs_of(loop.policies))
    assert (table["measured"] == "rollout").sum() == 4 * n_programs * 2
    assert (table["measured"] == "steps").sum() == 2 * len(PARTS) * 3
    effects = table[table["measured"] == "effect"]
    assert list(effects["program"].unique()) == [BASE, FOLLOWING, "grade", TWO_EFFECTS, LOOP_WITH_TWO]
    assert set(effects["n_vehicles"]) == {3}
    assert set(effects["batch"]) == {8}
    assert written["effect_ratio_grade_n3_b8"] == pytest.approx(1.5)
    table = table[table["measured"] != "effect"]  # where Base is listed with each of them
    assert not table.duplicated(["measured", "program", "n_vehicles", "batch", "repetition"]).any()
    assert "synthetic" in results.read_metadata(folder / "bench_loop.parquet")["references"]
    assert (folder / "config.json").exists()
    said = capsys.readouterr().out
    assert "goal at most 25%, kept" in said
    assert "15 synthetic ones of 60 s with 10 vehicles from seed 0; no data were read" in said


def test_steps_alone_and_a_finished_study_is_left_alone(log, tmp_path):
    loop = LoopOptions(batches=(), steps_repetitions=2)
    task = LoopBenchmark(results=ResultsConfig(root=str(tmp_path), resume=True), loop=loop)
    summary = run(task)
    assert summary["detection_share_largest"] is None
    n_asked = len(log)
    assert n_asked == 2 * len(PARTS) * 3  # batches x programs x (warm-up and two measurements)
    again = run(task)
    assert len(log) == n_asked
    assert again["steps_ms_ppo_n10_b256"] == summary["steps_ms_ppo_n10_b256"]


class Bar:
    """A progress bar that adds up."""

    advanced = 0

    def add_task(self, description, total):
        return 0

    def update(self, task, description, advance):
        self.advanced += advance

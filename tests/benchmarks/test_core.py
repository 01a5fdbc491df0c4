import json
from dataclasses import replace

import pandas as pd
import pytest

from benchmarks import core
from benchmarks.core import compare_scenes, measure_alone, measure_in_turn, measure_memory, numbers_of_threads, run
from benchmarks.options import CoreBenchmark, CoreOptions, Peer
from benchmarks.programs import GPU, OURS
from rearl_jax import results
from rearl_jax.config import ResultsConfig
from rearl_jax.problems import InvalidInputError
from rearl_jax.timing.measurement import Measurement


class Fake:
    """A program of constant speed that notes when it is asked."""

    def __init__(self, name, unit, cost, log):
        self.name, self.cost, self.log = name, cost, log
        self.facts = {"unit": unit}

    def measure(self, n_scenarios, seed):
        self.log.append((self.name, n_scenarios, seed))
        cpu_s = n_scenarios * self.cost
        figures = {"n_scenarios": n_scenarios, "seconds": 60, "n_substeps": 9000 * n_scenarios}
        return Measurement(**figures, cpu_s=cpu_s, wall_s=cpu_s, mean_speed=20.0)

    def close(self):
        pass


def test_programs_take_turns_after_a_warm_up():
    log = []
    programs = {OURS: Fake(OURS, 4, 0.1, log), "c": Fake("c", 16, 0.01, log), "slow": Fake("slow", 1, 9.0, log)}
    bench = CoreOptions(repetitions=3, repetition_cpu_s=2.0, seed=10)
    series = measure_in_turn(programs, 10, bench, lambda doing, advance: None)
    assert log[:3] == [(OURS, 4, 10), ("c", 16, 10), ("slow", 1, 10)]
    measured = log[3:]
    counts = {OURS: 20, "c": 192, "slow": 1}
    assert [name for name, _, _ in measured] == [OURS, "c", "slow", "slow", "c", OURS, OURS, "c", "slow"]
    assert all(count == counts[name] for name, count, _ in measured)
    assert [seed for _, _, seed in measured] == [11] * 3 + [12] * 3 + [13] * 3
    assert [(item.program, len(item.measurements)) for item in series] == [(OURS, 3), ("c", 3), ("slow", 3)]
    measure_in_turn(programs, 10, replace(bench, vehicles=(5, 10), scenarios=(6, 7)), lambda doing, advance: None)
    assert [count for name, count, _ in log[-9:] if name == OURS] == [7, 7, 7]


def test_settings_take_turns_and_keep_their_own_facts(monkeypatch):
    log, told = [], []

    def start(n_vehicles, bench, **others):
        told.append((n_vehicles, others))
        session = Fake(str(others["chunk"]), others["chunk"], 0.1, log)
        session.facts |= others
        return session

    monkeypatch.setattr(core, "start_ours", start)
    bench = CoreOptions(repetitions=2, repetition_cpu_s=0.1, varied_vehicles=7)
    series = measure_alone(bench, "chunk", (1, 2), lambda n: {"chunk": n, "threads": 1}, lambda doing, advance: None)
    assert told == [(7, {"chunk": 1, "threads": 1}), (7, {"chunk": 2, "threads": 1})]
    assert [name for name, _, _ in log] == ["1", "2", "1", "2", "2", "1"]
    assert [item.facts["chunk"] for item in series] == [1, 2]
    assert all(item.n_vehicles == 7 and len(item.measurements) == 2 for item in series)


def test_cores_are_doubled_up_to_all(monkeypatch):
    for cores, expected in ((1, (1,)), (2, (1, 2)), (6, (1, 2, 4, 6)), (8, (1, 2, 4, 8))):
        monkeypatch.setattr(core.runtime, "available_cores", lambda cores=cores: cores)
        assert numbers_of_threads(CoreOptions()) == expected
    assert numbers_of_threads(CoreOptions(threads=())) == ()


def test_cpu_and_gpu_are_compared_on_the_same_scenes():
    log = []
    programs = {OURS: Fake(OURS, 4, 0.1, log), GPU: Fake(GPU, 64, 0.1, log)}
    compare_scenes(programs, 10, CoreOptions(seed=3))
    assert log == [(OURS, 64, 3), (GPU, 64, 3)]


def test_an_earlier_benchmark_with_other_vehicles_is_refused(tmp_path):
    (tmp_path / "summary.json").write_text(
        json.dumps({"task": "bench core", "ratio_to_c_n7": 1, "ratio_to_c_n7_min": 1, "ratio_to_c_n7_max": 1})
    )
    bench = CoreOptions(against=str(tmp_path))
    with pytest.raises(InvalidInputError) as caught:
        run(CoreBenchmark(results=ResultsConfig(root=str(tmp_path)), bench=bench))
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", "bench.vehicles")


@pytest.mark.thorough
def test_benchmark_writes_everything(tmp_path, capsys):
    (tmp_path / "then").mkdir()
    then = {f"ratio_to_highway_env_n3{end}": 1e9 for end in ("", "_min", "_max")}
    (tmp_path / "then" / "summary.json").write_text(json.dumps({"task": "bench core"} | then))
    small = {"vehicles": (3,), "seconds": 2, "repetitions": 2, "scenarios": (8,), "chunk": 4, "memory_rollouts": 0}
    against = {"against": str(tmp_path / "then"), "reference": Peer.highway_env, "peers": (Peer.highway_env,)}
    bench = CoreOptions(**small, **against, chunks=(), threads=())
    task = CoreBenchmark(study="tiny", results=ResultsConfig(root=str(tmp_path)), bench=bench)
    summary = run(task)
    assert summary["n_slower"] == 1
    assert 0 < summary["change_n3"] < 0.01
    folder = tmp_path / "tiny"
    written = json.loads((folder / "summary.json").read_text())
    assert summary.items() <= written.items()
    assert written["scenarios_n3"] == 8
    assert written["substeps_per_cpu_s_n3"] > 0
    assert written["highway_env_substeps_per_cpu_s_n3"] > 0
    assert written["ratio_to_highway_env_n3"] > 0
    table = pd.read_parquet(folder / "bench_core.parquet")
    assert list(table.groupby("program").size()) == [2, 2]
    assert set(table.loc[table["program"] == OURS, "n_substeps"]) == {8 * 3 * 2 * 15}
    assert json.loads(results.read_metadata(folder / "bench_core.parquet")["machine"])["cpu_cores"] >= 1
    assert (folder / "cost.png").stat().st_size > 10_000
    assert (folder / "config.json").exists()
    said = capsys.readouterr().out
    assert "highway-env" in said


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_rollouts():
    few, many = (measure_memory(CoreOptions(seconds=10, chunk=64, memory_rollouts=count)) for count in (128, 20_000))
    assert many.n_scenarios == 20_000
    assert many.lane_changes > few.lane_changes > 0
    assert many.peak_memory_bytes < few.peak_memory_bytes + 100 * 2**20

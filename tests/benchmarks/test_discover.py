"""Cost of discovery: sizes that were measured are kept, and one small command is really carried out."""

import json

import pandas as pd
import pytest

from benchmarks import discover as module
from benchmarks.discover import MEANINGS, measure, run, scenario_of
from benchmarks.options import DiscoverBenchmark, DiscoverOptions
from rearl_jax.config import ResultsConfig
from rearl_jax.runtime import describe_machine
from tests.benchmarks.documented import check_documented

SIZES = DiscoverOptions(drivers=(9, 18), seconds=(30, 60))


@pytest.fixture
def asked(monkeypatch):
    """Sizes that were measured, by something that only pretends to; the third one is interrupted once."""
    sizes = []

    def pretend(options, drivers, seconds):
        sizes.append((drivers, seconds))
        if len(sizes) == 3:
            raise KeyboardInterrupt
        costs = {"wall_s": 2.0 * drivers, "cpu_s": 3.0, "peak_memory_gib": 0.5}
        return {"drivers": drivers, "seconds": seconds, "n_drivers": drivers, **costs}

    monkeypatch.setattr(module, "measure", pretend)
    return sizes


def test_an_interruption_loses_no_size(asked, tmp_path, capsys):
    task = DiscoverBenchmark(results=ResultsConfig(root=str(tmp_path)), discover=SIZES)
    with pytest.raises(KeyboardInterrupt):
        run(task)
    summary = run(task)
    assert asked == [(9, 30), (9, 60), (18, 30), (18, 30), (18, 60)]
    assert summary["wall_s_d18_s60"] == 36.0
    folder = tmp_path / "bench_discover"
    assert summary.items() <= json.loads((folder / "summary.json").read_text()).items()
    table = pd.read_parquet(folder / "bench_discover.parquet")
    assert list(zip(table["drivers"], table["seconds"], strict=True)) == [(9, 30), (9, 60), (18, 30), (18, 60)]
    assert "Discovery with empty caches" in capsys.readouterr().out
    keys = summary.keys() - describe_machine().keys()
    assert len(keys) == 16 + 1
    check_documented(keys, MEANINGS)


def test_a_finished_benchmark_is_measured_anew_unless_it_is_resumed(asked, tmp_path):
    task = DiscoverBenchmark(
        results=ResultsConfig(root=str(tmp_path)), discover=DiscoverOptions(drivers=(9,), seconds=(30,))
    )
    run(task)
    run(task)
    assert len(asked) == 2
    again = DiscoverBenchmark(results=ResultsConfig(root=str(tmp_path), resume=True), discover=task.discover)
    assert run(again)["wall_s_d9_s30"] == 18.0
    assert len(asked) == 2


@pytest.mark.parametrize("drivers", [9, 10, 240])
def test_enough_drivers_follow_a_leader(drivers):
    scenario = scenario_of(SIZES, drivers, 60)
    assert scenario.n_recordings * (scenario.n_vehicles - scenario.n_lanes) >= drivers
    assert scenario.duration == 60.0


@pytest.mark.slow
def test_a_command_is_measured_as_a_whole():
    row = measure(DiscoverOptions(replicates=2), 12, 60)
    assert (row["drivers"], row["seconds"], row["n_drivers"]) == (12, 60, 12)
    assert row["wall_s"] > 1
    assert row["cpu_s"] > 1
    assert row["peak_memory_gib"] > 0.1


@pytest.mark.thorough
def test_a_command_that_fails_is_quoted():
    with pytest.raises(RuntimeError, match=r"(?s)ended with code 2.*discover.max_drivers must be at least 9"):
        measure(DiscoverOptions(), 3, 20)

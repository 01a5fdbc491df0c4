"""Benchmark of the readers: every layout it writes is sound for its reader, and one is really measured."""

import json

import pytest

from benchmarks.layouts import LAYOUTS, traffic
from benchmarks.options import ReadersBenchmark, ReadersOptions
from benchmarks.readers import MEANINGS, read, run
from rearl_jax.config import ResultsConfig
from rearl_jax.problems import InvalidInputError
from rearl_jax.runtime import describe_machine
from tests.benchmarks.documented import check_documented

ROWS = traffic(4000)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_is_read_row_for_row(name, tmp_path):
    LAYOUTS[name].write(ROWS, tmp_path)
    found = read(name, tmp_path)
    assert found["rows"] == len(ROWS) // 5 * 5 if name == "openacc_raw" else found["rows"] == len(ROWS)
    size = max(file.stat().st_size for file in tmp_path.iterdir())
    assert size / len(ROWS) == pytest.approx(LAYOUTS[name].row_bytes, rel=0.2)


def test_a_layout_is_measured_in_a_process_of_its_own(tmp_path, capsys):
    task = ReadersBenchmark(
        results=ResultsConfig(root=str(tmp_path)), readers=ReadersOptions(layouts=("vissim",), megabytes=0.2)
    )
    summary = run(task)
    assert summary["rows_vissim"] > 3000
    assert 0.0 < summary["start_memory_gib_vissim"] < summary["peak_memory_gib_vissim"] < 2.0
    stored = json.loads((tmp_path / "bench_readers" / "summary.json").read_text())
    assert summary.items() <= stored.items()
    assert "vissim" in capsys.readouterr().out
    check_documented(summary.keys() - describe_machine().keys(), MEANINGS, layout=LAYOUTS)


def test_an_unknown_layout_is_refused(tmp_path):
    task = ReadersBenchmark(results=ResultsConfig(root=str(tmp_path)), readers=ReadersOptions(layouts=("punch_card",)))
    with pytest.raises(InvalidInputError) as caught:
        run(task)
    assert caught.value.problem.key == "readers.layouts"

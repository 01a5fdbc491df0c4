"""Benchmark of the readers: every layout it writes is sound for its reader, and one is really measured."""

import json

import pytest

from benchmarks.layouts import LAYOUTS
from benchmarks.options import ReadersBenchmark, ReadersOptions
from benchmarks.readers import MEANINGS, read, run
from rearl_jax.config import ResultsConfig
from rearl_jax.problems import InvalidInputError
from rearl_jax.runtime import describe_machine
from tests.benchmarks.documented import check_documented

BYTES = 400_000
OF_TRAFFIC = ("sumo_xml", "sumo_csv", "vissim", "openacc_raw", "table_csv")


def _written(name: str, text: str) -> int:
    """Rows that a reader must find in a file; of pNEUMA, those in both directions on the whole street."""
    n_lines = text.count("\n")
    match name:
        case "sumo_xml":
            return text.count("<vehicle ")
        case "vissim":
            return n_lines - 5
        case "openacc_raw":
            return 5 * (n_lines - 6)
        case "i24":
            return sum(len(document["timestamp"]) for document in json.loads(text))
        case "pneuma":
            return sum((line.count(";") - 4) // 6 for line in text.splitlines()[1:])
    return n_lines - 1


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_is_read_row_for_row(name, tmp_path):
    LAYOUTS[name].write(tmp_path, BYTES)
    file = max(tmp_path.iterdir(), key=lambda file: file.stat().st_size)
    # Files of sensors end with a whole vehicle, or with several.
    assert 0.8 * BYTES < file.stat().st_size < (1.2 if name in OF_TRAFFIC else 3.0) * BYTES
    n_written, n_read = _written(name, file.read_text()), read(name, tmp_path)["rows"]
    if name == "pneuma":
        # Half of the vehicles drive the other way, and the stretch is 7/8 of the street.
        assert n_read == pytest.approx(0.5 * 7 / 8 * n_written, rel=0.2)
    else:
        assert n_read == n_written


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

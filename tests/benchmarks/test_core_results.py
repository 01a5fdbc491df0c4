import json
import re
from pathlib import Path

import pytest
from PIL import Image

from benchmarks import core
from benchmarks.core import show
from benchmarks.core_results import MEANINGS, Agreement, Change, CoreResults, read_ratios
from benchmarks.figure import draw_costs
from benchmarks.options import CoreBenchmark, CoreOptions, Peer
from benchmarks.programs import C_ALL, GPU, OURS, Absent
from rearl_jax.config import ResultsConfig
from rearl_jax.problems import InvalidInputError, MissingInputError
from rearl_jax.timing.measurement import Measurement, Series, Spread
from tests.benchmarks.documented import check_documented

KEPT = Path(__file__).resolve().parents[2] / "results" / "kept" / "bench_core"

MACHINE = {"cpu_model": "a processor", "cpu_cores": 2, "jax_version": "1"}


def run(cpu_s, wall_s=1.0, **others):
    figures = {"n_scenarios": 10, "seconds": 61, "n_substeps": 1_000_000, "mean_speed": 20.0, **others}
    return Measurement(cpu_s=cpu_s, wall_s=wall_s, **figures)


def series(program, n_vehicles, *costs, **others):
    facts = {"unit": 1, "chunk": 8, "threads": 2, "compile_s": 3.0} if program == OURS else {"unit": 1}
    return Series(program, n_vehicles, tuple(run(cost, cost / 2, **others) for cost in costs), facts)


@pytest.fixture
def results():
    return CoreResults(
        series=(
            series(OURS, 10, 1.0, 2.0, 4.0, lane_changes=30, crashed=5, peak_memory_bytes=2**30),
            series("c", 10, 4.0, 2.0, 2.0),
            series(C_ALL, 10, 4.0, 4.0, 4.0),
            series("highway_env", 10, 1000.0, 4000.0, 4000.0, lane_changes=40, crashed=0),
            series(OURS, 200, 6.0, 6.0, 6.0, lane_changes=30, crashed=5, peak_memory_bytes=2**30),
            series("c", 200, 3.0, 3.0, 3.0),
            series("highjax", 200, 300.0, 300.0, 300.0),
            series(GPU, 200, 1.0, 1.0, 1.0),
        ),
        absent=(Absent("libsumo", "not installed", "pip install it"),),
        memory=run(5.0, 9.0, n_scenarios=100_000, peak_memory_bytes=3 * 2**28),
        load_average=1.5,
        machine=MACHINE,
        by_chunk=(series(OURS, 10, 1.0), series(OURS, 10, 2.0)),
        by_threads=(series(OURS, 10, 1.0),),
        agreements=(Agreement(200, run(1.0, lane_changes=100, crashed=4), run(1.0, lane_changes=110, crashed=5)),),
        changes=(
            Change(10, Spread(2.0, 1.9, 2.1), Spread(1.0, 0.9, 1.1), 0.15),
            Change(200, Spread(2.0, 1.9, 2.1), Spread(2.0, 1.9, 2.1), 0.15),
        ),
    )


def test_ratios_are_taken_within_repetitions(results):
    ratio = results.ratio("c", 10)
    assert (ratio.median, ratio.least, ratio.greatest) == (1.0, 0.5, 4.0)
    assert results.ratio("highway_env", 10).median == 1000
    assert results.ratio("highway_env", 200) is None
    # Both on all cores: by elapsed time.
    slow = run(100.0, 2.0)
    one = Series(C_ALL, 10, (slow,), {"unit": 1})
    ours = Series(OURS, 10, (run(1.0, 1.0),), {"unit": 1})
    assert CoreResults((ours, one), (), None, None, MACHINE).ratio(C_ALL, 10).median == 2


def test_medians_and_traffic(results):
    ours = results.find(OURS, 10)
    assert ours.substeps_per_cpu_s == 500_000
    assert ours.substeps_per_s == 1_000_000
    assert ours.lane_changes_per_vehicle_min == pytest.approx(30 / 100)
    assert ours.crashed_share == pytest.approx(5 / 100)
    assert results.find("c", 10).lane_changes_per_vehicle_min is None
    assert results.find("c", 10).crashed_share is None
    assert results.cost_growth() == {10: 3}


def test_every_figure_of_the_summary_is_documented(results):
    summary = results.summary()
    assert summary["substeps_per_cpu_s_n10"] == 500_000
    assert summary["ratio_to_c_n10"] == 1.0
    assert summary["ratio_to_highway_env_n10_max"] == 1000 or summary["ratio_to_highway_env_n10_max"] == 2000
    assert summary["cost_ratio_n200_to_n10"] == 3
    assert summary["peak_memory_gib_100k"] == 0.75
    assert summary["ratio_to_gpu_n200"] == pytest.approx((1 / 3.0) / (1 / 0.5))
    assert summary["gpu_lane_changes_error_n200"] == pytest.approx(0.1)
    assert summary["gpu_crashed_error_n200"] == pytest.approx(1 / 2000)
    assert (summary["change_n10"], summary["change_n200"], summary["n_slower"]) == (0.5, 1, 1)
    assert summary["absent"] == [{"program": "libsumo", "reason": "not installed", "remedy": "pip install it"}]
    assert "ratio_to_libsumo_n10" not in summary
    peers = ("c", "c_all_threads", "highway_env", "libsumo", "highjax", "gpu")
    check_documented(summary.keys() - MACHINE.keys(), MEANINGS, peer=peers)


def test_table_has_a_row_per_measurement(results):
    table = results.table()
    assert len(table) == 3 * 8 + 3
    assert set(table["varied"]) == {"vehicles", "chunk", "threads"}
    table = table[table["varied"] == "vehicles"]
    assert not table.duplicated(["program", "n_vehicles", "repetition"]).any()
    ours = table[(table["program"] == OURS) & (table["n_vehicles"] == 10)]
    assert list(ours["substeps_per_cpu_s"]) == [1e6, 5e5, 2.5e5]
    assert table["crashed"].dtype == "Int64"
    assert table.loc[table["program"] == "c", "crashed"].isna().all()


def test_terminal_shows_speeds_ratios_and_absent_programs(results, capsys):
    show(results)
    said = capsys.readouterr().out
    (row,) = re.findall(r"^.*highway-env .*$", said, re.MULTILINE)
    assert "1,000 (1,000 to 2,000)" in row
    assert "absent: libsumo (not installed); pip install it" in said
    assert "peak_memory_gib_100k: 0.75" in said
    assert re.search(r"^ *200 .* ok", said, re.MULTILINE)
    assert re.search(r"^ *10 .* 0\.500 .* SLOWER", said, re.MULTILINE)
    assert "…" not in said


def test_figure_is_drawn(results, tmp_path):
    file = tmp_path / "cost.png"
    file.write_bytes(draw_costs(results))
    with Image.open(file) as image:
        assert image.width > 500
        assert len(image.convert("RGB").getcolors(1 << 20)) > 10


THEN = Spread(2.0, 1.8, 2.2)


@pytest.mark.parametrize(
    ("now", "is_slower"),
    [
        (Spread(2.0, 1.9, 2.1), False),
        (Spread(1.75, 1.7, 1.8), False),  # within the margin
        (Spread(1.5, 1.4, 1.6), True),
        (Spread(1.5, 1.4, 2.1), False),  # one repetition was as fast as usual: noise
        (Spread(3.0, 2.9, 3.1), False),
    ],
)
def test_slower_is_beyond_margin_and_noise(now, is_slower):
    assert Change(10, THEN, now, 0.15).is_slower == is_slower


def test_factor_holds_all_pairs_of_repetitions():
    factor = Change(10, THEN, Spread(1.0, 0.9, 1.1), 0.15).factor
    assert (factor.median, factor.least, factor.greatest) == pytest.approx((0.5, 0.9 / 2.2, 1.1 / 1.8))


def test_ratios_are_read_from_a_file_or_its_folder(tmp_path):
    figures = {f"ratio_to_c_n{n}{end}": value for n in (10, 1000) for end, value in (("", 2), ("_min", 1), ("_max", 3))}
    file = tmp_path / "summary.json"
    file.write_text(json.dumps({"task": "bench core", **figures, "ratio_to_c_all_threads_n10": 9}))
    expected = {10: Spread(2.0, 1.0, 3.0), 1000: Spread(2.0, 1.0, 3.0)}
    assert read_ratios(str(file), Peer.c) == read_ratios(str(tmp_path), Peer.c) == expected
    with pytest.raises(InvalidInputError) as caught:
        read_ratios(str(file), Peer.libsumo)
    assert (caught.value.code, caught.value.problem.key) == ("reference-absent", "bench.reference")


def test_ratios_are_read_from_the_kept_benchmark():
    assert read_ratios(str(KEPT), Peer.c)[10].median == pytest.approx(1.66, abs=0.01)


@pytest.mark.parametrize("text", ["no JSON", "[]", '{"task": "bench loop"}'])
def test_other_files_are_refused(tmp_path, text):
    file = tmp_path / "summary.json"
    file.write_text(text)
    with pytest.raises(InvalidInputError) as caught:
        read_ratios(str(file), Peer.c)
    assert (caught.value.code, caught.value.problem.key) == ("benchmark-unreadable", "bench.against")


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(MissingInputError) as caught:
        read_ratios(str(tmp_path / "nowhere"), Peer.c)
    assert (caught.value.code, caught.value.problem.file) == ("file-missing", str(tmp_path / "nowhere"))


def test_a_reference_that_is_absent_now_is_no_success(tmp_path, monkeypatch):
    then = {f"ratio_to_c_n10{end}": 1 for end in ("", "_min", "_max")}
    (tmp_path / "summary.json").write_text(json.dumps({"task": "bench core"} | then))
    absent = Absent("c", "there is no C compiler gcc", "install gcc")
    ours = series(OURS, 10, 1.0, lane_changes=30, crashed=5)
    monkeypatch.setattr(core, "measure", lambda bench: CoreResults((ours,), (absent,), None, 0.0, MACHINE))
    bench = CoreOptions(vehicles=(10,), against=str(tmp_path))
    with pytest.raises(InvalidInputError) as caught:
        core.run(CoreBenchmark(results=ResultsConfig(str(tmp_path)), bench=bench))
    assert (caught.value.code, caught.value.problem.remedy) == ("reference-absent", "install gcc")
    assert json.loads((tmp_path / "bench_core" / "summary.json").read_text())["n_slower"] == 0

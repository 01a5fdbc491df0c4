import re

import pytest

from benchmarks.loop import show
from benchmarks.loop_programs import NEVER, programs_of, quiet
from benchmarks.loop_results import MEANINGS, Cell, LoopResults
from benchmarks.options import LoopPolicy
from rearl_jax.timing.decision_steps import BASE, DECISION, DETECTION, LOOP, PAPER_MS, PARTS, PPO
from rearl_jax.timing.measurement import Measurement, Series
from tests.benchmarks.documented import check_documented

MACHINE = {"cpu_model": "a processor", "cpu_cores": 2, "jax_version": "1"}
POLICIES = tuple(LoopPolicy)


def series(program, n_vehicles, *costs):
    """One scenario of one second: costs are CPU times [s]."""
    figures = {"n_scenarios": 1, "seconds": 1, "n_substeps": 15 * n_vehicles, "mean_speed": 20.0, "crashed": 1}
    runs = tuple(Measurement(cpu_s=cost, wall_s=2 * cost, **figures) for cost in costs)
    return Series(program, n_vehicles, runs, {"unit": 1, "compile_s": 3.0, "asked_share": 0.0})


def cell(n_vehicles, batch, **costs):
    return Cell(n_vehicles, batch, {name: series(name, n_vehicles, *values) for name, values in costs.items()})


@pytest.fixture
def measured():
    costs = {
        BASE: (1.0, 2.0, 1.0),
        NEVER: (1.1, 3.0, 1.2),
        quiet(LoopPolicy.rank): (1.4, 4.0, 1.5),
        quiet(LoopPolicy.raw): (1.4, 4.0, 1.5),
        quiet(LoopPolicy.idle): (1.1, 3.0, 1.2),
        "rank": (2.0, 3.0, 4.0),
        "raw": (2.0, 3.0, 4.0),
        "idle": (0.5, 1.0, 0.5),
    }
    steps = {BASE: (4e-3,), PPO: (5e-3,), LOOP: (9e-3,), DETECTION: (1e-3,), DECISION: (3e-3,)}
    return LoopResults(
        cells=tuple(cell(n, batch, **costs) for n in (10, 30) for batch in (1, 2048)),
        steps=(cell(10, 1, **steps), cell(10, 256, **steps)),
        effects=(
            cell(10, 2048, base=(1.0, 2.0, 1.0), following=(2.0, 2.0, 3.0)),
            cell(10, 2048, base=(1.0, 2.0, 1.0), grade=(1.5, 6.0, 1.5)),
        ),
        policies=POLICIES,
        n_steps=10,
        references="2 synthetic ones",
        load_average=1.5,
        machine=MACHINE,
    )


def test_shares_and_ratios_are_taken_within_repetitions(measured):
    first = measured.cells[0]
    assert (first.detection.median, first.detection.least, first.detection.greatest) == pytest.approx((0.2, 0.1, 0.5))
    added = first.policy(LoopPolicy.rank)
    assert (added.median, added.least, added.greatest) == pytest.approx((0.3, 0.3, 0.5))
    ratio = first.ratio("rank")
    assert (ratio.median, ratio.least, ratio.greatest) == (2.0, 1.5, 4.0)
    assert measured.largest_detection_share == pytest.approx(0.2)
    assert measured.steps[0].steps_ms(LOOP).median == 18


def test_cost_is_per_scenario_and_second():
    figures = {"n_scenarios": 4, "seconds": 5, "n_substeps": 1, "mean_speed": 1.0}
    run = Series(BASE, 10, (Measurement(cpu_s=2.0, wall_s=9.0, **figures),), {})
    assert Cell(10, 2, {BASE: run}).costs(BASE) == [0.1]


def test_every_figure_of_the_summary_is_documented(measured):
    summary = measured.summary()
    assert summary["detection_share_n30_b2048_max"] == pytest.approx(0.5)
    assert summary["cpu_us_idle_n10_b1"] == 5e5
    assert summary["steps_cpu_ms_decision_n10_b1"] == 3
    assert summary["effect_ratio_grade_n10_b2048_max"] == 3
    assert summary["effect_ns_grade_n10_b2048"] == pytest.approx(1.5e9 / 150)
    assert {key: summary[f"paper_ms_{key}"] for key in PAPER_MS} == PAPER_MS
    names = {"policy": LoopPolicy.__members__, "part": PARTS, "method": PAPER_MS, "effect": ("following", "grade")}
    check_documented(summary.keys() - MACHINE.keys(), MEANINGS, program=programs_of(POLICIES), **names)


def test_parts_of_the_benchmark_can_be_left_out(measured, capsys):
    no_steps = LoopResults(measured.cells, (), (), POLICIES, 10, "none", None, MACHINE)
    assert not any(name.startswith(("steps", "paper")) for name in no_steps.summary())
    show(no_steps)
    assert "decision steps" not in capsys.readouterr().out
    no_rollouts = LoopResults((), measured.steps, (), POLICIES, 10, "none", None, MACHINE)
    assert no_rollouts.summary()["detection_share_largest"] is None
    assert no_rollouts.summary()["steps_ms_ppo_n10_b1"] == 10
    assert set(no_rollouts.table()["measured"]) == {"steps"}
    show(no_rollouts)
    assert "+rank" not in capsys.readouterr().out


def test_terminal_shows_shares_ratios_and_the_paper(measured, capsys):
    show(measured)
    said = capsys.readouterr().out
    assert "0.200 (0.100 to 0.500)" in said
    assert "goal at most 25%, kept" in said
    assert re.search(r"^ *loop +1 +18\.0", said, re.MULTILINE)
    assert re.search(r"grade +\S+ +1\.50 \(1\.50 to 3\.00\)", said)
    assert "rearl 86,241.0" in said
    assert "two_effects: reaction_delay and several_leaders" in said
    assert "…" not in said


def test_a_missed_goal_is_said(measured, capsys):
    costs = {name: item.measurements[0].cpu_s for name, item in measured.cells[0].series.items()} | {NEVER: 1.3}
    slow = cell(10, 1, **{name: (cost,) for name, cost in costs.items()})
    show(LoopResults((slow,), (), (), POLICIES, 10, "none", None, MACHINE))
    assert "missed in 1 of 1 rows" in capsys.readouterr().out

"""Inference times: what is made of measurements, a language model behind a stub, and the command from end to end."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from rearl_jax.config import StudyTable4Task
from rearl_jax.config.llm import LlmConfig, PromptConfig
from rearl_jax.config.study import StepsConfig
from rearl_jax.document.table import Cell, Emphasis
from rearl_jax.study import language_model_steps as module
from rearl_jax.study.language_model_steps import fresh_client
from rearl_jax.study.table4_figure import draw_timings
from rearl_jax.study.table4_tables import MODEL, conclusions, long_timings, sections, summary_of
from rearl_jax.timing import decision_steps
from rearl_jax.timing.decision_steps import BASE, PARTS
from tests.llm.stub import Stub


@pytest.fixture
def steps():
    cost = dict(zip(PARTS, (1.0, 3.0, 2.0, 0.25, 0.5), strict=True))
    rows = [
        {"program": name, "batch": batch, "wall_s": cost[name] * batch * factor, "compile_s": 2.0}
        for name in PARTS
        for batch in (1, 256)
        for factor in (0.9, 1.0, 1.4)
    ]
    return pd.DataFrame(rows)


def shown_rows(table):
    """Rows of the table that people read."""
    (section,) = sections(StudyTable4Task(), table, {"n_steps": 10})
    return section.tables[0].rows


@pytest.fixture
def with_model():
    counts = {"n_questions": 100, "n_sent": 90, "n_answered": 80}
    return pd.DataFrame([{"batch": 1, "repetition": 0, "wall_s": 50.0, "n_steps": 10, "model": "small", **counts}])


def test_medians_stand_beside_the_paper_for_one_scenario_only(steps):
    timings = long_timings(steps, None)
    assert timings["title"].tolist()[::2] == [
        "IDM+MOBIL",
        "PPO",
        "REARL, detection alone",
        "REARL, matcher alone",
        "REARL, whole loop with matcher",
    ]
    assert timings.loc[0, ["ours", "low", "n_repetitions", "paper"]].tolist() == [1000, 900, 3, 0.461]
    assert pd.isna(timings.loc[1, "paper"])
    shown = shown_rows(timings)
    assert (shown[-1].title, shown[-1].emphasis) == ("paper: REARL (language model)", Emphasis.subdued)
    assert shown[-1].cells[-1] == Cell("86,241.0")
    assert shown[0].cells == tuple(map(Cell, ("1", "1,000", "900", "1,400", "1,000", "2.00", "0.461")))
    table = timings.set_index(["row", "batch"])
    assert table.loc[("ppo", 1), "paper"] == 15.898
    assert pd.isna(table.loc[("loop", 1), "paper"])  # the paper's REARL asks a language model
    assert summary_of(timings, 10)["steps_ms_loop_b256"] == 2000 * 256


def test_conclusions_compare_ours_with_ours(steps, with_model):
    said = conclusions(long_timings(steps, with_model), 10)
    assert said[0] == (
        "Batch 1: times IDM+MOBIL: PPO 3.00, REARL, whole loop with matcher 2.00; of its time: REARL, detection alone "
        "25 % and REARL, matcher alone 50 %."
    )
    assert "small: 100 questions, 90 sent, 80 answered" in said[2]
    assert "5,000 ms per decision step" in said[2]
    assert said[-1].startswith("The paper orders")


def test_the_model_has_a_row_of_its_own(steps, with_model):
    timings = long_timings(steps, with_model)
    assert timings[["row", "paper"]].iloc[-1].tolist() == [MODEL, 86_241]
    assert shown_rows(timings)[-1].emphasis is Emphasis.plain
    assert draw_timings(timings, 10) != draw_timings(long_timings(steps, None), 10)


@pytest.mark.slow
def test_steps_with_a_language_model_ask_it_every_second(monkeypatch):
    monkeypatch.setattr(module, "LOOP_MODEL", replace(module.LOOP_MODEL, collisions=False))  # compile faster
    monkeypatch.setattr(decision_steps, "BASE_MODEL", replace(decision_steps.BASE_MODEL, collisions=False))
    monkeypatch.setattr(decision_steps, "WARM_UP_SECONDS", 2)
    loop = StepsConfig(steps=3, steps_vehicles=4, reference_seconds=60)
    with Stub() as stub, fresh_client(LlmConfig(), stub.url) as client:
        (one, two) = module.measure_model_steps(client, PromptConfig(), loop, 1, 2)
    assert (one.n_steps, one.batch, one.repetition) == (3, 1, 0)
    assert 3 <= one.n_questions <= 12
    assert 0 < one.n_sent <= one.n_questions
    assert 0 < one.n_answered <= one.n_questions
    assert one.wall_s > 0
    assert two.repetition == 1


@pytest.mark.slow
def test_the_command_measures_and_goes_on(rearl, tmp_path):
    keys = ["loop.steps_batches=[1]", "loop.steps_repetitions=3"]  # each batch is a program to compile
    printed = rearl(tmp_path, "study", "table4", *keys)
    assert "IDM+MOBIL" in printed
    folder = tmp_path / "study_table4"
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["n_steps"] == 10
    assert summary[f"steps_ms_{BASE}_b1"] > 0
    assert summary["steps_ms_ppo_b1"] > 0
    assert summary["paper_ms_rearl"] == 86_241
    rearl(tmp_path, "study", "table4", *keys)
    again = json.loads((folder / "summary.json").read_text())
    assert again == summary  # not measured again

"""Figures, rows, sections and findings of REARL on a better traffic model, from rows whose figures are made."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import StudyTable1Task
from rearl_jax.config.decision import PolicyName
from rearl_jax.config.driver import record_of
from rearl_jax.config.evaluation import EvaluationConfig, SeedScope
from rearl_jax.config.scenes import BoundarySource, Direction, SpeedNorm
from rearl_jax.config.study import Table1Config
from rearl_jax.document.terminal import text_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.evaluation.scores import REAL_VS_REAL
from rearl_jax.study import table1
from rearl_jax.study.document import document_of, long_table
from rearl_jax.study.traffic.findings import findings_of
from rearl_jax.study.traffic.rows import budget_task
from rearl_jax.study.traffic.tables import (
    HEADINGS_ON_TRAFFIC,
    PREFIX,
    figures_of_rows,
    long_rows_on_traffic,
    name_of,
    split_rows,
)
from tests.refusal import refused

EVAL = EvaluationConfig(resamples=200)
POLICIES = (None, PolicyName.idle, PolicyName.matcher)
ERRORS = {"base": 0.8, "boundary": 0.6, "calibrated": 0.5, "both": 0.4}
"""Errors of the traffic without REARL."""


def made_rows(gain=0.0, n_scenes=6, kinds=tuple(ERRORS)):
    """Idle brings .1 of every error; the matcher brings as much, and a gain on the last traffic."""
    scene = np.arange(n_scenes)
    parts = []
    for kind in kinds:
        for policy in POLICIES:
            error = ERRORS[kind] - 0.1 * (policy is not None)
            if policy is PolicyName.matcher:
                error += np.where(scene % 2, 0.02, -0.02) - (gain if kind == kinds[-1] else 0)
            parts.append(made(name_of(kind, policy), error, scene, policy))
    parts.append(made(PREFIX + REAL_VS_REAL, 0.45, scene, None).assign(position_error=np.nan))
    return pd.concat(parts, ignore_index=True)


def made(name, error, scene, policy):
    frame = pd.DataFrame({"row": name, "scene_id": scene})
    frame = frame.assign(**dict.fromkeys(HEADINGS_ON_TRAFFIC, error + 0.01 * scene))
    asked, changed = {None: (0, 0), PolicyName.idle: (30, 0), PolicyName.matcher: (30, 12)}[policy]
    return frame.assign(interventions=float(asked), changes=float(changed))


def test_rows_are_compared_with_the_same_traffic_without_rearl():
    figures = figures_of_rows(made_rows(), EVAL)
    idle = figures["recorded_both_idle", "h"]
    assert idle[""] == pytest.approx(0.325)
    assert idle["_low"] < idle[""] < idle["_high"]
    assert [idle[f"_less_base{end}"] for end in ("", "_low", "_high")] == pytest.approx([-0.1] * 3)
    assert "_less_base" not in figures["recorded_both", "h"]
    assert "_less_base" not in figures["recorded_both_idle", "interventions"]
    assert figures["recorded_calibrated_matcher", "changes"][""] == 12
    assert (PREFIX + REAL_VS_REAL, "position_error") not in figures


def test_kinds_that_are_absent_are_left_out():
    figures = figures_of_rows(made_rows(kinds=("base", "boundary")), EVAL)
    names = list(dict.fromkeys(name for name, _ in figures))
    table = long_rows_on_traffic(figures, 6, has_found=False)
    assert list(dict.fromkeys(table["row"])) == sorted(names, key=names.index)
    assert len(names) == 7
    assert len(findings_of(made_rows(kinds=("base",)), EVAL, "mape_a", has_found=False)) == 3
    without = made_rows()
    without = without[~without["row"].str.endswith(("_idle", "_matcher"))]
    assert "On the last traffic" not in " ".join(findings_of(without, EVAL, "mape_a", has_found=False))


@pytest.mark.parametrize(
    ("gain", "said"),
    [
        (0.0, "still brings traffic closer to the recording; its choices are not distinguished from keeping"),
        (0.1, "still brings traffic closer to the recording; its choices are closer than keeping"),
        (-0.1, "is not distinguished from traffic without REARL"),
        (-0.2, "of no use here; its choices are farther than keeping"),
    ],
)
def test_findings_follow_from_the_figures(gain, said):
    of_h, of_mape, rates = findings_of(made_rows(gain), EVAL, "mape_a", has_found=False)
    assert said in of_h
    assert said in of_mape
    assert "Base 0.825 (idle -0.100" in of_h
    assert "30.0 (Base), 12.0 of them" in rates
    assert "Between two recorded scenes it is 0.475" in of_h


def test_drivers_with_found_effects_have_one_name_in_table_and_findings():
    rows = made_rows()
    table = long_rows_on_traffic(figures_of_rows(rows, EVAL), 6, has_found=True)
    titles = {title.partition(":")[0] for title in table["title"] if "drivers" in title}
    said = " ".join(findings_of(rows, EVAL, "mape_a", has_found=True))
    assert titles
    assert all(title in said for title in titles)
    assert "calibrated" not in said


def paper_rows():
    records = [
        {"row": "base", "title": "base", "metric": name, "unit": "-", "ours": 0.5, "low": 0.4, "high": 0.6}
        | {"less_base": None, "less_base_low": None, "less_base_high": None}
        | {"paper": None, "paper_row": None, "n_scenes": 6, "n_rollouts": 30}
        for name in ("h", "mape_a")
    ]
    return long_table(records)


def printed(table):
    summary, remarks = {"n_scenes": 6}, Remarks("some data", ("a verdict",), ("a definition",))
    return text_of(document_of(table1.FORM, StudyTable1Task(), table, summary, remarks, generated=False))


def test_the_rows_of_the_paper_stay_as_they_are():
    own = long_rows_on_traffic(figures_of_rows(made_rows(), EVAL), 6, has_found=True)
    alone, both = printed(paper_rows()), printed(pd.concat([paper_rows(), own], ignore_index=True))
    for rows, place in ((paper_rows(), 0), (own, 1)):
        pd.testing.assert_frame_equal(split_rows(rows)[place], rows)
    title = "Started as recorded"
    assert title not in alone
    assert alone.startswith(both.split(title)[0].rstrip())
    assert "0.500" in both.split(title)[0]
    assert "repaired drivers, replayed neighbours: matcher" in " ".join(both.split())


def test_scenes_start_and_drive_as_recorded_whatever_the_rows_of_the_paper_do():
    task = budget_task(StudyTable1Task(table1=Table1Config(traffic=True)))
    assert (task.scenes.direction, task.scenes.boundary) == (Direction.per_direction, BoundarySource.measured)
    assert task.speed.norm is SpeedNorm.none
    assert task.study == StudyTable1Task().study


def test_keys_that_contradict_it_are_refused():
    config = StudyTable1Task(eval=replace(EVAL, seed_scope=SeedScope.run))
    with refused("out-of-range", key="eval.seed_scope"):
        budget_task(config)
    assert budget_task(StudyTable1Task(driver=record_of("idm")())).driver.model == "idm"

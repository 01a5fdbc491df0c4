"""Rows as data: which are chosen, and what each makes of the configuration."""

from dataclasses import replace

import pytest

from rearl_jax.config import (
    ClusterTask,
    EvaluateTask,
    StudyFig6Task,
    StudyFig7Task,
    StudyFig8Task,
    StudyTable1Task,
    StudyTable3Task,
    StudyTable4Task,
    SweepScaleTask,
    SweepThresholdsTask,
)
from rearl_jax.config._schema import finished
from rearl_jax.config.core import InitialSource
from rearl_jax.config.decision import DecisionConfig, MatchSpace, PolicyName
from rearl_jax.config.detection import ReferenceMode
from rearl_jax.config.driver import record_of
from rearl_jax.config.evaluation import EvaluationConfig, Method, SeedScope, Variant
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.config.study import Table1Config, Table4Config
from rearl_jax.results import config_hash
from rearl_jax.study.parts import part_record
from rearl_jax.study.published import TABLE1
from rearl_jax.study.rows import ROWS, Role, changed, chosen_rows, row_record
from tests.refusal import refused


def row_named(name):
    return next(row for row in ROWS if row.name == name)


def test_every_row_is_an_evaluation_of_its_own():
    config = StudyTable1Task(eval=EvaluationConfig(n_runs=3, seed=9))
    records = {row.name: row_record(row, config) for row in ROWS}
    assert len(records) == len(ROWS)
    assert len({config_hash(record) for record in records.values()}) == len(ROWS)
    for name, record in records.items():
        assert type(record) is EvaluateTask
        assert finished(record) == record
        assert record.study == f"study_table1/rows/{name}"
        assert record.results.resume
        assert record.eval.seed == 9  # keys of the study reach the rows
    assert records["base"].method is Method.base
    assert records["matcher_raw"].matcher.space is MatchSpace.raw
    assert records["matcher_drawn"].reference.mode is ReferenceMode.drawn
    assert records["matcher_rank"].reference.mode is ReferenceMode.spacing
    assert records["random_admissible"].decision.policy is PolicyName.random_admissible


def test_tables_of_the_paper_start_as_the_paper_does():
    paper = [kind() for kind in (StudyTable1Task, StudyFig6Task, StudyTable3Task, StudyFig7Task, SweepScaleTask)]
    paper += [row_record(row, StudyTable1Task()) for row in ROWS]
    paper.append(part_record(SweepThresholdsTask, StudyTable3Task(), "sweep"))
    for config in paper:
        assert (config.init.source, config.speed.norm) == (InitialSource.seed, SpeedNorm.minmax)
        assert (config.core.lanes, config.core.speed_limit) == (4, 30.0)
    assert part_record(ClusterTask, StudyFig8Task(), "cluster").speed.norm is SpeedNorm.minmax
    for config in (EvaluateTask(), SweepThresholdsTask()):
        assert (config.init.source, config.speed.norm) == (InitialSource.scene, SpeedNorm.none)


def test_a_language_model_is_asked_less():
    config = StudyTable1Task(table1=Table1Config(llm_interval=7, llm_runs=2))
    record = row_record(row_named("llm"), config)
    assert (record.detection.interval, record.eval.n_runs) == (7, 2)
    assert record.eval.seed_scope is SeedScope.run
    assert record.decision.policy is PolicyName.llm
    other = row_record(row_named("critical_llm"), config)
    assert (other.eval.n_runs, other.eval.seed_scope) == (5, SeedScope.run_x_scene)


def test_rows_are_chosen_in_the_order_of_the_table():
    every = [row.name for row in ROWS if not row.is_repaired]
    without = [row.name for row in chosen_rows(Table1Config())]
    assert without == [name for name in every if name not in ("llm", "critical_llm")]
    assert [row.name for row in chosen_rows(Table1Config(llm=True))] == every
    with_model = [row.name for row in chosen_rows(Table1Config(llm=True), "model.yaml")]
    assert with_model == [row.name for row in ROWS] != every
    assert [row.name for row in chosen_rows(Table1Config(rows=("idle", "base")))] == ["base", "idle"]
    assert [row.name for row in chosen_rows(Table1Config(rows=("llm",)))] == ["llm"]
    with refused("choice-unknown", key="table1.rows"):
        chosen_rows(Table1Config(rows=("base", "matcher_rnk")))
    with refused("key-missing", key="model"):
        chosen_rows(Table1Config(rows=("repaired",)))


def test_rows_with_drivers_of_their_own_leave_the_keys_aside():
    config = StudyTable1Task(model="model.yaml", driver=record_of("idm")(), mobil=MobilConfig(politeness=0.5))
    records = {row.name: row_record(row, config) for row in ROWS}
    for name, record in records.items():
        is_repaired = name in ("calibrated", "repaired", "repaired_matcher")
        assert (record.model is not None) == is_repaired
        has_own = record.method in (Method.ppo, Method.critical)
        assert record.driver.is_default == (has_own or is_repaired)
        assert record.mobil.is_default == has_own
    assert records["repaired"].variant is Variant.repaired
    assert records["calibrated"].variant is Variant.calibrated


def test_rows_stand_beside_rows_of_the_paper():
    beside = {row.paper for row in ROWS} - {None}
    assert beside <= set(TABLE1)
    assert {"base", "ppo", "critical"} <= beside
    assert all(row.paper is None for row in ROWS if row.role is Role.control)


def test_changes_name_keys_and_values_that_are_there():
    config = EvaluateTask()
    assert changed(config, "eval.n_runs", 2).eval.n_runs == 2
    assert config.eval.n_runs == 5
    with refused("key-unknown", key="n_run"):
        changed(config, "eval.n_run", 2)
    with refused("choice-unknown", key="method"):
        changed(config, "method", "bas")


@pytest.mark.parametrize(
    ("config", "code", "key"),
    [
        (StudyTable1Task(method=Method.ppo), "set-by-task", "method"),
        (StudyTable1Task(decision=DecisionConfig(PolicyName.idle)), "set-by-task", "decision.policy"),
        (StudyTable1Task(table1=Table1Config(rows=())), "out-of-range", "table1.rows"),
        (StudyTable1Task(table1=Table1Config(rows=("base", "base"))), "out-of-range", "table1.rows"),
        (StudyTable1Task(table1=Table1Config(llm_runs=0)), "out-of-range", "table1.llm_runs"),
        (StudyFig7Task(method=Method.rearl), "set-by-task", "method"),
        (StudyTable4Task(decision=DecisionConfig(PolicyName.idle)), "out-of-range", "decision.policy"),
        (StudyTable4Task(table4=Table4Config(llm_batches=(2, 2))), "out-of-range", "table4.llm_batches"),
    ],
)
def test_keys_that_mean_nothing_here_are_refused(config, code, key):
    with refused(code, key=key):
        finished(config)


def test_the_rows_of_another_study_can_be_used():
    config = StudyTable1Task(study="mine", table1=Table1Config(kept_in="theirs"))
    record = row_record(row_named("base"), config)
    assert record.study == "theirs/rows/base"
    own = row_record(row_named("base"), replace(config, table1=Table1Config()))
    assert config_hash(own) == config_hash(record)

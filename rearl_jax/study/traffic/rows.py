"""Rows of `table1.traffic`: four kinds of traffic, each without REARL and with it under every policy.

The traffic is made of components of the error budget, with its scenes, starts, drivers and thresholds; all rows of a
kind have the same initial states and the same random numbers. Finished rows are not simulated again.
"""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from rich.progress import Progress

from rearl_jax.config import StudyTable1Task
from rearl_jax.config._schema import finished
from rearl_jax.config.budget import BOUNDARY, CALIBRATED, FOUND, LANE_CHANGES, REARL, START, VARIATION, StudyBudgetTask
from rearl_jax.config.decision import PolicyName
from rearl_jax.config.evaluation import Method
from rearl_jax.config.scenes import BoundarySource, Direction, SpeedConfig, SpeedNorm
from rearl_jax.core.meta_actions import MetaAction
from rearl_jax.evaluation import task as evaluation
from rearl_jax.evaluation.estimates import grouped_mean
from rearl_jax.evaluation.interventions import DecisionLog
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study
from rearl_jax.study.budget.simulating import (
    ScoredScenes,
    Setting,
    kept_parts,
    reference_table,
    simulated_table,
    without_replay,
)
from rearl_jax.study.budget.task import prepared
from rearl_jax.study.parts import part_record
from rearl_jax.study.traffic.findings import findings_of
from rearl_jax.study.traffic.tables import PREFIX, figures_of_rows, long_rows_on_traffic, name_of

DRIVERS = (CALIBRATED, FOUND, LANE_CHANGES, VARIATION)
"""Components that belong to calibrated drivers."""

TRAFFIC: Mapping[str, tuple[str, ...]] = {
    "base": (START,),
    "boundary": (START, BOUNDARY),
    "calibrated": (START, *DRIVERS),
    "both": (START, BOUNDARY, *DRIVERS),
}
"""Kinds of traffic, and their components as far as the recordings and the model have them."""

ROW_TABLE = "traffic"
"""Name of the table of all rows scene by scene: a folder of parts."""

DEFINITION = (
    "REARL on improved traffic: each carriageway makes its own scenes, which start as recorded, without rescaled "
    "speeds; desired speeds are at most the highest recorded speed of the vehicle; the thresholds of all these rows "
    "are percentiles of base from highway-env's start; components of the traffic as in `rearl study budget`"
)
"""Differences of these rows from those of the paper."""


@dataclass(frozen=True)
class TrafficRows:
    """The rows of `table1.traffic` with their figures.

    Attributes:
        table: Rows of the long table of Table 1.
        figures: Keys of summary.json.
        notes: What follows from the figures, the origin of the drivers, and absent components.
    """

    table: pd.DataFrame
    figures: dict[str, float | None]
    notes: tuple[str, ...]


def budget_task(config: StudyTable1Task) -> StudyBudgetTask:
    """The task whose components the traffic is made of: scenes of one carriageway each, speeds as recorded.

    Raises:
        InvalidInputError: Keys contradict each other.
    """
    record = part_record(
        StudyBudgetTask,
        config,
        config.study,
        scenes=replace(config.scenes, direction=Direction.per_direction, boundary=BoundarySource.measured),
        speed=SpeedConfig(SpeedNorm.none),
        init=StudyBudgetTask().init,
    )
    return finished(record)


def check_traffic(config: StudyTable1Task) -> None:
    """Raise InvalidInputError if two keys contradict each other, before hours of work."""
    evaluation.check(without_replay(budget_task(config)))


def rows_on_traffic(config: StudyTable1Task, study: Study, bar: Progress) -> TrafficRows:
    """The rows, simulated and scored on the held-out scenes; the study keeps them and the calibrated drivers.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.study.budget.task.run`; or the lane of some vehicle is unknown.
    """
    setting, absent, origin = prepared(budget_task(config), study, bar)
    if START not in setting.components:
        message = "needs the lane of every vehicle, from which scenes start as recorded; these recordings lack some"
        raise InvalidInputError(Problem("lane-missing", message, key="table1.traffic"))
    rows = _scene_by_scene(config, setting, study, bar)
    figures = figures_of_rows(rows, setting.config.eval)
    has_found = FOUND in setting.components
    findings = findings_of(rows, setting.config.eval, setting.config.mape.column, has_found=has_found)
    return TrafficRows(
        long_rows_on_traffic(figures, len(setting.held_out), has_found=has_found),
        {
            f"{row}_{metric}{ending}": value
            for (row, metric), figure in figures.items()
            for ending, value in figure.items()
        },
        (*findings, *origin, *absent),
    )


def _scene_by_scene(config: StudyTable1Task, setting: Setting, study: Study, bar: Progress) -> pd.DataFrame:
    """One line per row of the table and scene: `row`, `scene_id`, every metric, `position_error` [m], `interventions`
    and `changes`, both per vehicle and minute.
    """

    def references(scored: ScoredScenes) -> pd.DataFrame:
        table = reference_table(setting, scored)
        return with_rates(table.assign(row=PREFIX + table["row"]), {"interventions": np.nan, "changes": np.nan})

    def simulated(kind: str, policy: PolicyName | None, scored: ScoredScenes) -> pd.DataFrame:
        own = _with_policy(config, setting, policy)
        components = frozenset(TRAFFIC[kind]) & frozenset(setting.components)
        with ExitStack() as contexts:
            make_policy = None
            if own.config.decision.policy.is_outside:
                from rearl_jax.evaluation.language_model import language_model  # slow to import: it brings a client

                model = contexts.enter_context(language_model(own.config, bar))
                make_policy = None if model is None else model.make_policy
            row = components if policy is None else components | {REARL}
            table, log = simulated_table(own, row, scored, make_policy)
        return with_rates(table.assign(row=name_of(kind, policy)), _interventions(own, log))

    def with_rates(table: pd.DataFrame, rates: Mapping[str, np.ndarray | float]) -> pd.DataFrame:
        return table.assign(**rates).astype(dict.fromkeys(rates, "Float64"))

    makers = {"references": references}
    makers |= {name_of(kind, policy): partial(simulated, kind, policy) for kind, policy in _rows(config, setting)}
    metadata = {"seeds": config.seeds, "scenes_id": setting.inputs.scenes.data_id}
    return kept_parts(ROW_TABLE, makers, setting, study, bar, metadata)


def _rows(config: StudyTable1Task, setting: Setting) -> Iterator[tuple[str, PolicyName | None]]:
    """Kinds of traffic whose components exist, each with its policies; None for traffic without REARL."""
    policies: list[PolicyName | None] = [None]
    if REARL in setting.components:
        policies += [PolicyName.idle, PolicyName.matcher, *([PolicyName.llm] if config.table1.llm else [])]
    for kind, components in TRAFFIC.items():
        needed = set(components) - {FOUND, LANE_CHANGES, VARIATION}  # a model may lack these
        if needed <= set(setting.components):
            for policy in policies:
                if policy is not PolicyName.llm or BOUNDARY not in components:
                    yield kind, policy


def _with_policy(config: StudyTable1Task, setting: Setting, policy: PolicyName | None) -> Setting:
    """The setting with a policy; a language model is asked less often and in fewer rollouts."""
    if policy is None:
        return setting
    task = replace(setting.config, decision=replace(setting.config.decision, policy=policy))
    if policy is PolicyName.llm:
        task = replace(
            task,
            method=Method.rearl,
            detection=replace(task.detection, interval=config.table1.llm_interval),
            eval=replace(task.eval, n_runs=config.table1.llm_runs),
        )
    return replace(setting, config=task)


def _interventions(setting: Setting, log: DecisionLog | None) -> dict[str, np.ndarray | float]:
    """Interventions per vehicle and minute, and those that change speed or lane, scene by scene."""
    if log is None:
        return {"interventions": 0.0, "changes": 0.0}
    accepted = np.asarray(log.decisions.n_accepted)  # [seconds, actions, rollouts]
    scene_index = np.searchsorted(setting.held_out, log.scene)
    per_vehicle_minute = 60 / (len(accepted) * setting.config.core.n_vehicles)
    keeping = accepted[:, MetaAction.IDLE].sum(axis=0)
    total = accepted.sum(axis=(0, 1))
    return {
        name: grouped_mean(values * per_vehicle_minute, scene_index, len(setting.held_out))
        for name, values in (("interventions", total), ("changes", total - keeping))
    }

"""Simulation and scoring of the rows of an error budget, one after the other; finished rows are not simulated again."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from rich.progress import Progress

from rearl_jax._typing import SceneIndices
from rearl_jax.config.budget import BOUNDARY, CALIBRATED, REARL, START, StudyBudgetTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import Method
from rearl_jax.config.scenes import BoundarySource
from rearl_jax.evaluation.estimates import grouped_mean, scene_means
from rearl_jax.evaluation.host_policy import MakePolicy
from rearl_jax.evaluation.inputs import Inputs
from rearl_jax.evaluation.interventions import DecisionLog
from rearl_jax.evaluation.positions import Positions
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row as SimulatedRow
from rearl_jax.evaluation.runner import example_scene, make_scorer, reference_rows, simulated_row
from rearl_jax.evaluation.scores import REAL, Scores, row_named, with_realism
from rearl_jax.evaluation.scoring import Scorer
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED
from rearl_jax.metrics import METRICS
from rearl_jax.models.record import RepairedModel
from rearl_jax.results import Study, part_name
from rearl_jax.study.budget.components import Row, row_name, rows_of, title_of_row
from rearl_jax.study.budget.drivers import drivers_of

ERRORS = "errors"
"""Name of the table of metrics: a folder of parts, which is read as one Parquet table."""


@dataclass(frozen=True)
class Setting:
    """What all rows of a budget have in common.

    Attributes:
        config: The task, with as many lanes and vehicles as the scenes need.
        inputs: Scenes, their splits, and representative scenes where REARL is a component.
        held_out: Indices of the scored scenes.
        components: The components, in the stated order (`budget.components`).
        model: The calibrated drivers; None if the budget has no calibrated drivers.
        thresholds: Thresholds of REARL's detection.
    """

    config: StudyBudgetTask
    inputs: Inputs
    held_out: SceneIndices
    components: tuple[str, ...]
    model: RepairedModel | None = None
    thresholds: tuple[float, float] = NEVER_EXCEEDED


@dataclass(frozen=True)
class ScoredScenes:
    """The recorded scenes with which all rows are compared.

    Attributes:
        scorer: Scorer that compares traffic with these scenes.
        references: Scores of the reference rows, such as real against real.
    """

    scorer: Scorer
    references: list[Scores]


def simulated_rows(setting: Setting, study: Study, bar: Progress, metadata: Mapping[str, str]) -> pd.DataFrame:
    """Metrics of every row of the budget and of the reference rows, scene by scene; the study keeps finished rows.

    Columns: `row`, `scene_id`, every metric (mean over runs), and for rows that start as recorded `position_error` [m]
    and `overlap_share` [-]. The position error is over the vehicles of the first snapshot, which all rows simulate.
    """

    def maker(row: Row) -> Callable[[ScoredScenes], pd.DataFrame]:
        return lambda scored: simulated_table(setting, row, scored)[0]

    makers = {"references": partial(reference_table, setting)}
    makers |= {title_of_row(row): maker(row) for row in rows_of(setting.components)}
    return kept_parts(ERRORS, makers, setting, study, bar, metadata)


def kept_parts(
    name: str,
    makers: Mapping[str, Callable[[ScoredScenes], pd.DataFrame]],
    setting: Setting,
    study: Study,
    bar: Progress,
    metadata: Mapping[str, str],
) -> pd.DataFrame:
    """The table with this name. Its parts are kept in the folder of the study, and finished parts are not made again.

    `makers` make one part each, by its title in the progress bar; `metadata` goes with every part.
    """
    finished, scored = study.finished_parts(name), None
    line = bar.add_task(name, total=len(makers))
    for number, (title, make) in enumerate(makers.items()):
        bar.update(line, description=f"row: {title}", completed=number)
        if number not in finished:
            scored = scored or _scored_scenes(setting)
            study.write_table(part_name(name, number), make(scored), **metadata)
    bar.update(line, completed=len(makers))
    return pd.read_parquet(study.path / name)


def _scored_scenes(setting: Setting) -> ScoredScenes:
    config, scenes = setting.config, setting.inputs.scenes
    scorer = make_scorer(config, scenes, config.eval.n_runs * len(setting.held_out))
    return ScoredScenes(scorer, reference_rows(config, scenes, setting.held_out, scorer))


def reference_table(setting: Setting, scored: ScoredScenes) -> pd.DataFrame:
    """Metrics of the reference rows, scene by scene."""
    complete = with_realism(scored.references, row_named(scored.references, REAL), setting.config.realism)
    return pd.concat([_table(setting, row) for row in complete], ignore_index=True)


def simulated_table(
    setting: Setting, row: Row, scored: ScoredScenes, host_policy: MakePolicy | None = None
) -> tuple[pd.DataFrame, DecisionLog | None]:
    """Metrics of a simulated row, scene by scene, and its decisions; the decisions are None without REARL.

    `host_policy` makes the policy if it decides outside the compiled program.
    """
    inputs, held_out = setting.inputs, setting.held_out
    rollouts = Rollouts([evaluation_row(setting, row)], inputs.scenes, held_out, inputs.references, host_policy)
    example = example_scene(inputs.scenes, held_out, None)
    scores, _, log, positions = simulated_row(row_name(row), rollouts, scored.scorer, inputs.scenes, held_out, example)
    (complete,) = with_realism([scores], row_named(scored.references, REAL), setting.config.realism)
    return _table(setting, complete, positions), log


def evaluation_row(setting: Setting, row: Row) -> SimulatedRow:
    """The row of an evaluation that simulates a row of the budget."""
    config = replace(setting.config, model=None, method=Method.rearl if REARL in row else Method.base)
    if START in row:
        config = replace(config, init=replace(config.init, source=InitialSource.scene))
    if BOUNDARY not in row:
        config = without_replay(config)
    drivers = None
    if CALIBRATED in row:
        assert setting.model is not None  # without a model, CALIBRATED is not among the components
        drivers = drivers_of(setting.model, row, config.core)
    thresholds = setting.thresholds if REARL in row else NEVER_EXCEEDED
    return SimulatedRow(config, row_name(row), thresholds, drivers=drivers)


def without_replay(config: StudyBudgetTask) -> StudyBudgetTask:
    """The configuration, but without replayed neighbours."""
    return replace(config, scenes=replace(config.scenes, boundary=BoundarySource.free))


def _table(setting: Setting, scores: Scores, positions: Positions | None = None) -> pd.DataFrame:
    """Metrics of a row, scene by scene."""
    held_out = setting.held_out
    scene_id = setting.inputs.scenes.scene_id[held_out]
    columns = {name: scene_means(scores, name, held_out) for name in METRICS}
    columns |= dict.fromkeys(("position_error", "overlap_share"), np.full(len(held_out), np.nan))
    if positions is not None:
        scene_index = np.searchsorted(held_out, positions.scene)
        columns["position_error"] = grouped_mean(positions.first_error, scene_index, len(held_out))
        columns["overlap_share"] = grouped_mean(positions.overlap, scene_index, len(held_out))
    frame = pd.DataFrame({"row": [scores.row] * len(held_out), "scene_id": scene_id.astype(np.int32)})
    nullable = {name: pd.arrays.FloatingArray(np.nan_to_num(v), ~np.isfinite(v)) for name, v in columns.items()}
    return frame.assign(**nullable)

"""Results of many rollouts in one table on disk, part by part; finished parts are not simulated again."""

import logging
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.runner import scored_rollouts
from rearl_jax.evaluation.scores import Scores
from rearl_jax.results import Study, part_name

log = logging.getLogger(__name__)

MAX_PART_ROLLOUTS = 16_384
"""Largest number of rollouts per part: seconds of computation, and a file of a few megabytes."""

RUNS = "runs"
"""Name of the table: a folder of parts, read as one Parquet table."""


def write_runs(
    study: Study,
    rollouts: Rollouts,
    scenes: SceneSet,
    table_of: Callable[[Rollouts, Scores], pd.DataFrame],
    metadata: dict[str, str],
    progress: Callable[[int, int], None],
    on_part: Callable[[int, int], None] = lambda number, n_rollouts: None,
) -> None:
    """Simulates and scores the rollouts and writes `runs/part-*.parquet`; finished parts are not simulated again.

    The parts do not depend on the machine, so a study may be continued on another machine.

    Args:
        study: Study whose folder holds the table.
        rollouts: All rollouts, with eval.seed_scope=run_x_scene.
        scenes: All scenes.
        table_of: Rows of a part.
        metadata: Metadata of every part besides the provenance.
        progress: Called with the number of rollouts done and their total.
        on_part: Called with the number of each part just written and its rollouts.
    """
    parts = parts_of(len(rollouts))
    finished = finished_parts(study, len(rollouts))
    if finished:
        log.info("%d of %d parts were simulated before", len(finished), len(parts))
    for number, part in enumerate(parts):
        if number not in finished:
            selected = rollouts[part]
            advance = partial(_advance, progress, part.start, len(rollouts))
            scores = scored_rollouts(selected, scenes, selected.scene, advance)
            study.write_table(part_name(RUNS, number), table_of(selected, scores), **metadata)
            on_part(number, len(selected))
        progress(part.stop, len(rollouts))


def parts_of(n_rollouts: int) -> list[slice]:
    """Ranges of rollouts of almost equal size, so that one compiled program serves all parts."""
    n_parts = math.ceil(n_rollouts / MAX_PART_ROLLOUTS)
    bounds = [number * n_rollouts // n_parts for number in range(n_parts + 1)]
    return [slice(start, stop) for start, stop in zip(bounds[:-1], bounds[1:], strict=True)]


def finished_parts(study: Study, n_rollouts: int) -> dict[int, slice]:
    """Finished parts on disk, by number; other files of the table are removed."""
    on_disk = study.finished_parts(RUNS)
    return {number: part for number, part in enumerate(parts_of(n_rollouts)) if number in on_disk}


def run_columns(scene_id: np.ndarray, rollouts: Rollouts, scores: Scores) -> dict[str, np.ndarray]:
    """Columns of every table of rollouts: `scene_id`, `run`, every metric."""
    keys = {"scene_id": scene_id[rollouts.scene].astype(np.int32), "run": rollouts.run.astype(np.int32)}
    return keys | {name: figures.astype(np.float32) for name, figures in scores.values.items()}


def _advance(progress: Callable[[int, int], None], start: int, total: int, done: int, of_part: int) -> None:
    """Reports `done` rollouts of a part that begins with rollout `start` as progress over all rollouts."""
    progress(start + done, total)

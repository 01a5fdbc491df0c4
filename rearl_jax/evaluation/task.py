"""The task `rearl evaluate`: recordings in; table, Parquet, figures and one page out.

Writes into the study folder `runs.parquet` (one row per scored pair), `frames.parquet` (one per pair and
frame), `summary.parquet` (one per method and metric), `summary.json` (one object per method or reference
row), three PNG figures, `page.html` and `config.json`.
"""

import logging
from collections.abc import Callable

import jax

from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import Precision
from rearl_jax.data.recordings import count_recordings, data_id, is_generated, iterate_recordings
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.data.scenes import build_scenes
from rearl_jax.data.splits import split_scenes
from rearl_jax.evaluation import tables, terminal
from rearl_jax.evaluation.estimates import estimates
from rearl_jax.evaluation.runner import evaluate
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study

log = logging.getLogger(__name__)


def run(config: EvaluateTask) -> dict:
    """The summary under `rows`: one object per row of the table, the method first, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, one is bad, too few scenes can be cut from
            them, or two keys contradict each other.
    """
    if config.hist.window > config.scenes.seconds:
        raise ValueError(
            f"hist.window = {config.hist.window} s is longer than a scene of {config.scenes.seconds} s: set it to "
            f"{config.scenes.seconds} or less"
        )
    if config.core.dtype is Precision.float64:
        jax.config.update("jax_enable_x64", True)
    study = Study(
        config.results.root,
        config.study,
        config,
        "evaluate",
        data_id(config.data),
        generated=is_generated(config.data),
    )
    study.write_config()
    with progress_bar() as bar:
        reading = bar.add_task("recordings", total=count_recordings(config.data))
        scenes = read_scenes(config, lambda: bar.advance(reading))
        splits = split_scenes(scenes, config.split)
        log.info("splits: %s", ", ".join(f"{name} {size}" for name, size in splits.summary().items()))
        simulating = bar.add_task("rollouts", total=None)
        evaluation = evaluate(
            config,
            scenes,
            splits.evaluation,
            lambda done, total: bar.update(simulating, completed=done, total=total),
        )
    found = estimates(evaluation.rows, evaluation.held_out, config.eval)
    metadata = tables.metadata(config, evaluation)
    study.write_table("runs", tables.run_table(evaluation), **metadata)
    study.write_table("frames", tables.frame_table(evaluation, config.hist.window), **metadata)
    study.write_table("summary", tables.summary_table(evaluation, found, config.eval.confidence), **metadata)
    rows = tables.summary_rows(evaluation, found)
    study.write_summary(rows)
    terminal.print_table(config, evaluation, found)

    # Only now, so that nobody waits for matplotlib to see the table.
    from rearl_jax.evaluation.figures import draw
    from rearl_jax.evaluation.page import render

    figures = draw(config, evaluation)
    for name, png in figures.items():
        study.write_bytes(f"{name}.png", png)
    study.write_text("page.html", render(config, evaluation, found, figures))
    return {"rows": rows}


def read_scenes(config: EvaluateTask, advance: Callable[[], None]) -> SceneSet:
    """Scenes of all recordings of the data set.

    Args:
        config: The task.
        advance: Called after each recording.
    """
    return build_scenes(
        iterate_recordings(config.data),
        config.scenes,
        config.speed,
        config.tracks,
        config.features,
        config.spacing,
        progress=lambda name, n_scenes: advance(),
    )

"""The task `rearl evaluate`: recordings in; table, Parquet, figures and one page out.

Writes into the study folder `runs.parquet` (one row per scored pair), `frames.parquet` (one per pair and
frame), `summary.parquet` (one per method and metric), `decisions.parquet` (one per rollout and second, where a
policy decides), `summary.json` (one object per method or reference
row), three PNG figures, `page.html` and `config.json`.
"""

import logging
from collections.abc import Callable, Iterable

import jax

from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import Precision
from rearl_jax.config.evaluation import Method
from rearl_jax.data.recordings import Recording, count_recordings, data_id, is_generated, iterate_recordings
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.data.scenes import build_scenes
from rearl_jax.data.splits import split_scenes
from rearl_jax.evaluation import tables, terminal
from rearl_jax.evaluation.estimates import estimates
from rearl_jax.evaluation.interventions import decision_table
from rearl_jax.evaluation.percentiles import detection_thresholds
from rearl_jax.evaluation.rollouts import NEVER
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
    is_held = config.method is not Method.base
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
        recordings, builder = iterate_recordings(config.data), None
        if is_held:
            # Here, because the method base does without scikit-learn, which takes its time to import.
            from rearl_jax.clustering.references import ReferenceBuilder

            builder = ReferenceBuilder(config)
            recordings = builder.passing(recordings)
        scenes = read_scenes(config, recordings, lambda: bar.advance(reading))
        splits = split_scenes(scenes, config.split)
        log.info("splits: %s", ", ".join(f"{name} {size}" for name, size in splits.summary().items()))
        references, thresholds = None, NEVER
        if builder is not None:
            references = builder.build(scenes, splits, study)[0]
            estimating = bar.add_task("thresholds", total=None)
            thresholds = detection_thresholds(
                config,
                scenes,
                splits.threshold,
                lambda done, total: bar.update(estimating, completed=done, total=total),
            )
            log.info("thresholds: Hellinger distance %.4f, spacing error %.4f", *thresholds)
        simulating = bar.add_task("rollouts", total=None)
        evaluation = evaluate(
            config,
            scenes,
            splits.evaluation,
            lambda done, total: bar.update(simulating, completed=done, total=total),
            references,
            thresholds,
        )
    found = estimates(evaluation.rows, evaluation.held_out, config.eval)
    metadata = tables.metadata(config, evaluation)
    study.write_table("runs", tables.run_table(evaluation), **metadata)
    study.write_table("frames", tables.frame_table(evaluation, config.hist.window), **metadata)
    study.write_table("summary", tables.summary_table(evaluation, found, config.eval.confidence), **metadata)
    if evaluation.log is not None:
        decisions = decision_table(scenes.scene_id, evaluation.log, config.hist.window)
        study.write_table("decisions", decisions, **metadata)
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


def read_scenes(config: EvaluateTask, recordings: Iterable[Recording], advance: Callable[[], None]) -> SceneSet:
    """Scenes of all recordings of the data set.

    Args:
        config: The task.
        recordings: The recordings, one after the other.
        advance: Called after each recording.
    """
    return build_scenes(
        recordings,
        config.scenes,
        config.speed,
        config.tracks,
        config.features,
        config.spacing,
        progress=lambda name, n_scenes: advance(),
    )

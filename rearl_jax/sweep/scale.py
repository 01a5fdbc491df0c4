"""The task `rearl sweep scale`: a stream of rollouts, simulated and scored in constant memory, with their cost.

Writes into the study folder `cost.parquet` (one row per batch size), `runs/part-*.parquet` (one row per rollout),
`progress.parquet` (one row per part), `scale.png`, `config.json` and, last of all, `summary.json`. A killed study
continues where it stopped.
"""

import json
import math
from dataclasses import asdict, replace

import pandas as pd
from rich.progress import Progress

from rearl_jax import runtime
from rearl_jax._typing import SceneIndices
from rearl_jax.config import SweepScaleTask
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.data.recordings import is_generated
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.detection.references import References
from rearl_jax.document.terminal import print_document
from rearl_jax.evaluation.boundaries import check_boundary
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.percentiles import thresholds_of
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.scores import Scores
from rearl_jax.evaluation.traffic import inputs_id, require_one_variant
from rearl_jax.machine import load_average
from rearl_jax.problems import out_of_range
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study
from rearl_jax.runtime import set_precision
from rearl_jax.sweep.parts import finished_parts, run_columns, write_runs
from rearl_jax.sweep.scale_costs import batch_costs
from rearl_jax.sweep.scale_document import document_of
from rearl_jax.sweep.scale_progress import StreamLog, shown_with_rate
from rearl_jax.sweep.scale_results import ScaleResults


def run(config: SweepScaleTask) -> dict:
    """The summary: rates, memory, cost of a rollout by the number simulated at a time.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, too few scenes can be cut from
            them, or two keys contradict each other.
    """
    config.check()
    if config.eval.seed_scope is not SeedScope.run_x_scene:
        message = "must be run_x_scene: every rollout is scored against its own scene"
        raise out_of_range("eval.seed_scope", message, config.eval.seed_scope.name)
    require_one_variant(config)
    check_boundary(config)
    set_precision(config.core.dtype)
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "sweep scale", inputs_id(config), generated=generated)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    with progress_bar() as bar:
        results = _measured(config, study, bar, generated=generated)
    print_document(document_of(results))

    # Imported after the table is printed, because matplotlib is slow to import.
    from rearl_jax.sweep.scale_figure import draw_scale

    study.write_bytes("scale.png", draw_scale(results))
    summary = results.summary()
    study.write_summary(summary)
    return summary


def _measured(config: SweepScaleTask, study: Study, bar: Progress, *, generated: bool) -> ScaleResults:
    """Results of the measured batch sizes and of the stream, after both are written."""
    load = load_average()
    inputs = read_inputs(config, study, bar, with_references=config.method.needs_references)
    scenes, subset = inputs.scenes, inputs.held_out(config.eval)
    thresholds = thresholds_of(config, inputs, bar)
    rollouts = list_rollouts(config, scenes, subset, inputs.references, thresholds)
    machine = runtime.describe_machine()
    metadata = {
        "seeds": config.seeds,
        "scenes_id": scenes.data_id,
        "thresholds": json.dumps([str(value) for value in thresholds]),
    }
    with_machine = metadata | {"machine": json.dumps(machine)}
    costs = batch_costs(rollouts, scenes, shown(bar, "batch sizes"))
    study.write_table("cost", pd.DataFrame(map(asdict, costs)), **with_machine)

    def table_of(part: Rollouts, scores: Scores) -> pd.DataFrame:
        return pd.DataFrame(run_columns(scenes.scene_id, part, scores))

    parts_on_disk = list(finished_parts(study, len(rollouts)).values())
    stream = StreamLog(study, sum(part.stop - part.start for part in parts_on_disk), with_machine)
    progress = shown_with_rate(bar, "rollouts", parts_on_disk)
    write_runs(study, rollouts, scenes, table_of, metadata, progress, stream.add)
    return ScaleResults(config, len(subset), scenes.seconds, thresholds, costs, stream, machine, load, generated)


def list_rollouts(
    config: SweepScaleTask,
    scenes: SceneSet,
    subset: SceneIndices,
    references: References | None,
    thresholds: tuple[float, float],
) -> Rollouts:
    """Exactly `n_rollouts` rollouts: as many runs of every scene as needed, the last run incomplete."""
    n_rollouts = int(config.n_rollouts)
    with_runs = replace(config, eval=replace(config.eval, n_runs=math.ceil(n_rollouts / len(subset))))
    row = Row(with_runs, config.method.name, thresholds)
    return Rollouts([row], scenes, subset, references)[:n_rollouts]

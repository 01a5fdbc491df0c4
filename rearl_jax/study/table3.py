"""The task `rearl study table3`: the threshold pairs compared with the known part of the paper's Table 3.

The pairs are simulated by `rearl sweep thresholds` in `sweep/`. Writes `table3.parquet` (one row per pair and figure),
`table3.png`, `page.html`, `config.json` and, last of all, `summary.json`.
"""

from rearl_jax.config import StudyTable3Task, SweepThresholdsTask
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.progress import progress_bar
from rearl_jax.results import read_summary
from rearl_jax.study import differences
from rearl_jax.study.document import Form, publish, remarks_on
from rearl_jax.study.pair_results import read_pairs
from rearl_jax.study.parts import begin, carry_out, part_record
from rearl_jax.study.published import N_THRESHOLD_SCENES, N_TUNING_SCENES
from rearl_jax.study.table3_tables import conclusions, long_pairs, sections, summary_of
from rearl_jax.sweep import task

_CAPTIONS = {
    "table3": (
        "Both errors of every pair on the tuning scenes. Left: with base; bars are intervals of the best pair and of "
        "base. Right: the pairs alone, named by the percentiles of Hellinger distance and spacing error; the line "
        "joins those that no other beats in both errors, diamonds mark the paper's."
    ),
    "pairs": "The same errors as maps, from the sweep.",
}

FORM = Form("table3", "Threshold pairs, compared with Table 3 of the paper", sections, _CAPTIONS)


def run(config: StudyTable3Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.sweep.task.run`.
    """
    study = begin("study table3", config, inputs_id(config))
    folder = carry_out(task.run, part_record(SweepThresholdsTask, config, f"{config.study}/sweep"))
    sweep = read_summary(folder)
    pairs = read_pairs(folder, config, (sweep["best_h_pct"], sweep["best_m_pct"]))
    with progress_bar() as bar:
        inputs = read_inputs(config, study, bar, with_references=True)
    scenes, splits = inputs.scenes, inputs.splits
    assert inputs.references is not None  # read_inputs was called with_references
    n_runs = config.eval.n_runs
    differing = (
        *differences.of_data(config, scenes),
        *differences.of_subset(len(splits.threshold), N_THRESHOLD_SCENES, "threshold scenes", n_runs),
        *differences.of_subset(len(splits.tuning), N_TUNING_SCENES, "tuning scenes", n_runs),
        *differences.of_references(inputs.references.speed.shape[0], config),
        *differences.of_model(config, scenes),
        *differences.of_errors(config),
        *differences.of_decisions(),
        "choice of the pair: smallest sum of both errors; the paper does not state its criterion",
    )
    use = f"{len(splits.tuning)} of them simulated under every pair"
    summary = summary_of(config, pairs, sweep)

    def draw() -> dict[str, bytes]:
        from rearl_jax.study.table3_figure import draw_pairs

        drawn = draw_pairs(pairs, len(splits.tuning), generated=scenes.generated)
        return {"table3": drawn, "pairs": (folder / "pairs.png").read_bytes()}

    publish(
        study,
        FORM,
        config,
        scenes,
        long_pairs(pairs),
        summary,
        remarks_on(config, scenes, use, conclusions(pairs, sweep, len(splits.tuning)), differing),
        draw,
        seeds=config.seeds,
    )
    return summary

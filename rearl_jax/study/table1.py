"""The task `rearl study table1`: comparison of the methods with each other and with the paper's Table 1.

Every row is evaluated as by `rearl evaluate`, in the folder `rows/NAME`; rows of `table1.traffic` are in `traffic/`.
Writes `table1.parquet` (one line per row of the table and metric), `table1.png`, `page.html`, `config.json` and, last
of all, `summary.json`.
"""

import pandas as pd

from rearl_jax.config import StudyTable1Task
from rearl_jax.evaluation.inputs import Inputs, read_inputs
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.progress import progress_bar
from rearl_jax.study import differences
from rearl_jax.study.document import Form, publish, remarks_on
from rearl_jax.study.findings import findings
from rearl_jax.study.parts import begin
from rearl_jax.study.published import N_EVALUATION_SCENES
from rearl_jax.study.row_results import Results, evaluate_rows
from rearl_jax.study.table1_tables import long_rows, sections, summary_of, verdict
from rearl_jax.study.traffic.rows import DEFINITION, check_traffic, rows_on_traffic

_CAPTION = (
    "Every row with its interval. Diamonds are the paper's figures of the same row, which come from other data. H is "
    "on the scale that the paper likely uses. The grey line is the measured traffic: real against real for the errors, "
    "the scenes themselves for time headway and lane-change rate."
)

FORM = Form("table1", "Methods, compared with Table 1 of the paper", sections, {"table1": _CAPTION})


def run(config: StudyTable1Task) -> dict:
    """Runs the study; returns the content of summary.json.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, too few scenes can be cut from
            them, two keys contradict each other, or a chosen row does not exist.
    """
    if config.table1.traffic:
        check_traffic(config)
    study = begin("study table1", config, inputs_id(config))
    results = evaluate_rows(config)
    traffic = None
    with progress_bar() as bar:
        inputs = read_inputs(config, study, bar, with_references=results.has_references)
        if config.table1.traffic:
            traffic = rows_on_traffic(config, study, bar)
    compared, confidence, generated = results.differences(config), config.eval.confidence, inputs.scenes.generated
    sentences = findings(compared, n_scenes=results.n_scenes, confidence=confidence, generated=generated)
    table, summary = long_rows(results), summary_of(config, results, sentences)
    notes = [verdict(table), *sentences]
    if traffic is not None:
        table = pd.concat([table, traffic.table], ignore_index=True)
        summary |= traffic.figures
        notes += traffic.notes

    def draw() -> dict[str, bytes]:
        from rearl_jax.study.table1_figure import draw_rows

        return {"table1": draw_rows(config, results, generated=generated)}

    publish(
        study,
        FORM,
        config,
        inputs.scenes,
        table,
        summary,
        remarks_on_rows(config, results, inputs, notes, *([] if traffic is None else [DEFINITION])),
        draw,
        seeds=config.seeds,
    )
    return summary


def remarks_on_rows(
    config: StudyTable1Task, results: Results, inputs: Inputs, findings: list[str], *further: str
) -> Remarks:
    """Remarks on the rows of Table 1: conclusions, and differences from the paper.

    Args:
        config: The task.
        results: The rows.
        inputs: Scenes, and representative scenes, from which the rows were made.
        findings: Conclusions from the figures; the first sentence is the verdict.
        *further: Further differences from the paper, each as `name: text`.
    """
    n_scored, references = len(inputs.held_out(config.eval)), inputs.references
    purpose = f"{config.eval.subset.name} scenes"
    differing = [
        *further,
        *differences.of_data(config, inputs.scenes),
        *differences.of_subset(results.n_scenes, N_EVALUATION_SCENES, purpose, config.eval.n_runs),
        *differences.of_model(config, inputs.scenes),
        *differences.of_errors(config),
        *differences.of_decisions(config.table1 if any(item.row.asks_model for item in results.rows) else None),
        *([] if references is None else differences.of_references(references.speed.shape[0], config)),
        *differences.of_traffic_figures(),
    ]
    return remarks_on(config, inputs.scenes, f"{n_scored} of them held out for this study", findings, differing)

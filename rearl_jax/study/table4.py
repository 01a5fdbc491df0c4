"""The task `rearl study table4`: the time of ten consecutive decisions, compared with the paper's Table 4.

Measurements are kept in `steps/`, those with a language model in `llm/`. Writes `table4.parquet` (one row per program
and batch), `table4.png`, `page.html`, `config.json` and, last of all, `summary.json`.
"""

import json
import logging
from dataclasses import asdict
from typing import Any

import pandas as pd

from rearl_jax import runtime
from rearl_jax.config import StudyTable4Task
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.machine import load_average
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study, read_metadata
from rearl_jax.study.document import Form, publish
from rearl_jax.study.language_model_steps import fresh_client, measure_model_steps
from rearl_jax.study.table4_tables import conclusions, long_timings, sections, summary_of
from rearl_jax.timing.decision_steps import count_reports, measure_steps
from rearl_jax.timing.turns import reporting

log = logging.getLogger(__name__)

STEPS = "steps"
"""Name of the table of the measurements."""

MODEL_STEPS = "llm_steps"
"""Name of the table of the measurements with a language model."""

_DIFFERENCES = (
    "unit: the paper gives a time for 10 decisions without stating whether it is that of all ten or of one, and "
    "for how many vehicles",
    "machine: the paper used another machine; the time of a language model is that of its server",
    "program: here a whole batch is one compiled program; the paper does not state how it runs its simulation",
    "content of a step: here it includes the simulated second, except in the rows of detection alone and of decisions "
    "alone, which read recorded traffic",
    "references: synthetic, because the time does not depend on recorded data",
)

_CAPTION = (
    "Elapsed time of the consecutive decision steps, whole batch: median, least and greatest of the measurements. "
    "Diamonds: the paper's figures, whose unit is ambiguous, from another machine."
)

FORM = Form("table4", "Inference time, compared with Table 4 of the paper", sections, {"table4": _CAPTION})


def run(config: StudyTable4Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        ImportError, OSError, ValueError: The language model cannot be reached, see `fresh_client`.
    """
    if not config.loop.steps_batches:
        message = "must hold at least one batch size"
        raise InvalidInputError(Problem("key-missing", message, key="loop.steps_batches"))
    study = Study(config.results.root, config.study, config, "study table4")
    study.write_config()
    with_model = _timings_with_model(config) if config.table4.llm else None
    steps, measured_on = _timings(config)
    table = long_timings(steps, with_model)
    loop, n_steps = config.loop, config.loop.steps
    machine, load = measured_on["machine"], measured_on["load_average"]
    measured = f"Measured on {machine}" + ("" if load is None else f", load {load:.1f} at the start")
    data = (
        f"No recordings were read; there are {loop.n_references} synthetic references of {loop.reference_seconds} s "
        f"with {loop.reference_vehicles} vehicles from seed {loop.seed}. {measured}; median of "
        f"{loop.steps_repetitions} measurements after a warm-up."
    )
    summary = {"machine": machine, "load_average": load} | summary_of(table, n_steps)

    def draw() -> dict[str, bytes]:
        from rearl_jax.study.table4_figure import draw_timings

        return {"table4": draw_timings(table, n_steps)}

    publish(
        study,
        FORM,
        config,
        None,
        table,
        summary,
        Remarks(data, tuple(conclusions(table, n_steps)), _DIFFERENCES),
        draw,
        machine=machine,
    )
    return summary


def _timings(config: StudyTable4Task) -> tuple[pd.DataFrame, dict[str, Any]]:
    """One row per program, batch and measurement, and the machine; read from disk if measured before."""
    part = Study(config.results.root, f"{config.study}/steps", config.loop, "study table4")
    path = part.path / f"{STEPS}.parquet"
    if not part.owns(STEPS):
        machine = runtime.machine_line(runtime.describe_machine(), None)
        measured_on = {"machine": machine, "load_average": load_average()}
        with reporting(count_reports(config.loop)) as report:
            rows = [
                {"program": program, "batch": batch, "repetition": number, **asdict(run)}
                | {"compile_s": series.facts["compile_s"]}
                for batch in config.loop.steps_batches
                for program, series in measure_steps(config.loop, batch, report).items()
                for number, run in enumerate(series.measurements)
            ]
        part.write_table(STEPS, pd.DataFrame(rows), measured_on=json.dumps(measured_on))
    return pd.read_parquet(path), json.loads(read_metadata(path)["measured_on"])


def _timings_with_model(config: StudyTable4Task) -> pd.DataFrame:
    """One row per batch and measurement, with the fields of `ModelSteps`; read from disk if measured before."""
    part = Study(config.results.root, f"{config.study}/llm", config, "study table4")
    if not part.owns(MODEL_STEPS):
        rows = []
        with fresh_client(config.llm, config.decision.server) as client, progress_bar() as bar:
            show = shown(bar, "language model")
            batches = config.table4.llm_batches
            for number, batch in enumerate(batches):
                show(number, len(batches))
                log.info("language model: %d decision steps, %d scenarios at a time", config.loop.steps, batch)
                rows += measure_model_steps(client, config.prompt, config.loop, batch, config.table4.llm_repetitions)
            model = client.server.model
        table = pd.DataFrame([asdict(row) for row in rows]).assign(model=model)
        part.write_table(MODEL_STEPS, table, model=model)
    return pd.read_parquet(part.path / f"{MODEL_STEPS}.parquet")

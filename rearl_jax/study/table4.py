"""The task `rearl study table4`: the time of ten consecutive decisions beside the paper's Table 4.

The steps are measured by `rearl bench loop` in `steps/`, those with a language model in `llm/`. Writes `table4.parquet`
(one row per program and batch), `table4.png`, `page.html`, `config.json` and, last of all, `summary.json`.
"""

import json
import logging
from dataclasses import asdict
from functools import partial
from pathlib import Path

import pandas as pd

from rearl_jax.bench import loop
from rearl_jax.bench.fresh_client import fresh_client
from rearl_jax.bench.language_model_steps import measure_model_steps
from rearl_jax.config import BenchLoopTask, StudyTable4Task
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study
from rearl_jax.study.parts import carry_out, part_record
from rearl_jax.study.report import Report, finish
from rearl_jax.study.table4_tables import Timing, conclusions, long_timings, shown_timings, summary_of, timings_of

log = logging.getLogger(__name__)

MODEL_STEPS = "llm_steps"
"""Name of the table of the measurements with a language model."""

_DIFFERENCES = (
    "unit: the paper's figures are of 10 decisions; whether of all ten or of one of them, and of how many vehicles, it "
    "does not say",
    "machine: the paper's is another one, and a language model's time is that of its server",
    "program: here a whole batch is one compiled program; how the paper runs its simulation it does not say",
    "what a step holds: here the simulated second too, except in the rows detection and decision alone, which look at "
    "recorded traffic",
    "references: synthetic, so no data are read and nothing is said about traffic",
)

_CAPTION = (
    "Elapsed time of the consecutive decision steps, median of the measurements with least and greatest, whole batch. "
    "Diamonds: the paper's figures, of an ambiguous unit and from another machine."
)

CAPTIONS = {"table4": _CAPTION}
"""What is below the figure."""


def run(config: StudyTable4Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        ImportError, OSError, ValueError: The language model asked for cannot be asked, see `fresh_client`.
    """
    if not config.loop.steps_batches:
        said = "must name scenarios at a time: this table is made of decision steps"
        raise InvalidInputError(Problem("key-missing", said, key="loop.steps_batches"))
    study = Study(config.results.root, config.study, config, "study table4")
    study.write_config()
    with_model = _measured_with_model(config) if config.table4.llm else None
    folder = carry_out(loop.run, part_record(BenchLoopTask, config, f"{config.study}/steps"))
    measured = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    timings = timings_of(pd.read_parquet(folder / "bench_loop.parquet"), with_model)
    n_steps = config.loop.steps
    said = conclusions(timings, n_steps)
    load = measured["load_average"]
    machine = f"{measured['cpu_model']}, {measured['cpu_cores']} cores, jax {measured['jax_version']}"
    report = Report(
        title="Inference time beside Table 4 of the paper",
        tables=(shown_timings(timings, n_steps, config.loop.steps_vehicles),),
        findings=tuple(said),
        differences=_DIFFERENCES,
        data={
            "summary": f"No data were read: {measured['references']}. Measured on {machine}"
            + ("" if load is None else f", load {load:.1f} at the start")
            + f"; median of {config.loop.steps_repetitions} measurements after a warm-up.",
            "sources": [],
        },
        generated=False,
        captions=CAPTIONS,
    )
    summary = {"machine": machine, "load_average": load} | summary_of(timings, n_steps)
    draw = partial(_draw, timings, n_steps)
    finish(study, "study table4", config, report, long_timings(timings), summary, draw, machine=machine)
    return summary


def _draw(timings: list[Timing], n_steps: int) -> dict[str, bytes]:
    from rearl_jax.study.table4_figure import draw_timings

    return {"table4": draw_timings(timings, n_steps)}


def _measured_with_model(config: StudyTable4Task) -> pd.DataFrame:
    """One row per batch and measurement, as `ModelSteps` has them; from disk where it was measured before."""
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
    return pd.read_parquet(Path(part.path) / f"{MODEL_STEPS}.parquet")

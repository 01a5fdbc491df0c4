"""The task `rearl study stability`: string stability, flow and collisions of simulated traffic.

The tables of each model are in `models/NAME/` and are kept if an interrupted study continues. Writes them joined
(`amplification.parquet`, `ring.parquet`, `flow.parquet`, `queue.parquet`, `traffic.parquet`, `measured.parquet`),
`verdict.json`, figures, `page.html`, `config.json` and, last of all, `summary.json`.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd

from rearl_jax.config.stability import StudyStabilityTask
from rearl_jax.data.recordings import data_id, is_generated, iterate_recordings, label_of_same
from rearl_jax.data.records import Recording
from rearl_jax.document.document import data_sources
from rearl_jax.document.publishing import publish_document
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.models.file import model_id
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.study.stability.amplification import amplification_table
from rearl_jax.study.stability.cases import Case, cases_of
from rearl_jax.study.stability.document import TABLES, document_of, summary_of
from rearl_jax.study.stability.figures import draw_figures
from rearl_jax.study.stability.flow import flow_table, queue_table, traffic_table
from rearl_jax.study.stability.measured import Pairs, measured_table, read_pairs
from rearl_jax.study.stability.rings import ring_table
from rearl_jax.study.stability.verdict import verdict_of

TASK = "study stability"


def run(config: StudyStabilityTask) -> dict[str, Any]:
    """The summary, as in summary.json.

    Raises:
        MissingInputError, BadModelError: There is no such model, or it cannot be read.
        FileNotFoundError, ValueError: There are no recordings, or they cannot be read.
    """
    cases, options = cases_of(config), config.stability
    inputs = [] if config.model is None else [model_id(config.model)]
    inputs += [data_id(config.data)] if options.measured else []
    input_ids = ", ".join(inputs) or None  # of the model file and the recordings that are read
    generated = options.measured and is_generated(config.data)
    study = Study(config.results.root, config.study, config, TASK, input_ids, generated=generated)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    recordings = list(iterate_recordings(config.data)) if options.measured else []
    pairs = read_pairs(recordings, options.seconds, label_of_same(config.data))
    tables_by_name: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
    with progress_bar() as bar:
        line = bar.add_task("", total=len(cases) * len(TABLES))
        for case in cases:
            folder = f"{config.study}/models/{case.name}"
            of_model = Study(config.results.root, folder, config, TASK, input_ids, generated=generated)
            made: dict[str, pd.DataFrame] = {}
            for name in TABLES:
                bar.update(line, description=f"{case.name}: {name}")
                made[name] = _table(name, case, config, made, pairs, of_model)
                tables_by_name[name].append(made[name])
                bar.advance(line)
    tables = {name: pd.concat(of_models, ignore_index=True) for name, of_models in tables_by_name.items()}
    verdict = [verdict_of(case.name, tables, pairs) for case in cases]
    remarks, summary = _remarks(cases, recordings), summary_of(tables, verdict)
    for name, table in tables.items():
        study.write_table(name, table, seeds=f"stability.seed={options.seed}", remarks=remarks.to_json())
    study.write_text("verdict.json", json.dumps(verdict, indent=2, allow_nan=False) + "\n")
    document = document_of(tables, verdict, remarks, margin=options.margin, generated=generated)
    draw = partial(draw_figures, tables, generated=generated)
    publish_document(study, document, config, summary, draw, data_id=input_ids)
    return summary


def _table(
    name: str, case: Case, config: StudyStabilityTask, made: Mapping[str, pd.DataFrame], pairs: Pairs, of_model: Study
) -> pd.DataFrame:
    """One of TABLES for one model, with its name in the first column; read from disk if made before.

    `made` are the model's tables before this one.
    """
    if not of_model.owns(name):
        options = config.stability
        make: dict[str, Callable[[], pd.DataFrame]] = {
            "amplification": lambda: amplification_table(case, options),
            "ring": lambda: ring_table(case, options),
            "flow": lambda: flow_table(case, options),
            "queue": lambda: queue_table(case, options),
            "traffic": lambda: traffic_table(case, made["flow"], made["queue"], options),
            "measured": lambda: measured_table(case, pairs, options.margin, options.seed),
        }
        table = make[name]()
        table.insert(0, "model", case.name)
        of_model.write_table(name, table, seeds=f"stability.seed={options.seed}")
    return pd.read_parquet(of_model.path / f"{name}.parquet")


def _remarks(cases: Sequence[Case], recordings: Sequence[Recording]) -> Remarks:
    """The recordings, and effects that the linear stability analysis of each model leaves out."""
    infos = tuple(recording.info for recording in recordings)
    notes = tuple(
        f"{case.name}: the linear stability analysis leaves out {', '.join(case.beyond_analysis)},"
        " the simulation does not"
        for case in cases
        if case.beyond_analysis
    )
    data = f"{len(infos)} recordings, whose followers are compared with simulated ones." if infos else ""
    return Remarks(data, notes, sources=data_sources(infos))

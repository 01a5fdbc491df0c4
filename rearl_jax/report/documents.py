"""The document of a finished study, by the task that made it."""

import json
from collections.abc import Callable
from importlib import import_module

from rearl_jax.document.document import Document
from rearl_jax.evaluation.document import DECISION_COLUMNS, SUMMARY_COLUMNS, document_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.report.discovery import blind_document, discovery_document
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.study.budget.document import document_of as budget_document_of
from rearl_jax.study.budget.tables import BUDGET_COLUMNS, STEP_COLUMNS
from rearl_jax.study.document import document_of as study_document_of
from rearl_jax.study.real.document import document_of as real_document_of
from rearl_jax.study.real.facts import FACT_COLUMNS
from rearl_jax.study.real.table import ROW_COLUMNS
from rearl_jax.study.stability.document import TABLES as STABILITY_TABLES
from rearl_jax.study.stability.document import document_of as stability_document_of
from rearl_jax.study.stability.rings import RING_COLUMNS
from rearl_jax.sweep.document import SUMMARY_KEYS
from rearl_jax.sweep.document import document_of as sweep_document_of


def evaluation_document(study: FinishedStudy) -> Document:
    """The document of an evaluation.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    summary = study.table("summary")
    study.require_keys(summary, SUMMARY_COLUMNS, "summary.parquet")
    decisions = None
    if (study.path / "decisions.parquet").exists():
        decisions = study.table("decisions")
        study.require_keys(decisions, DECISION_COLUMNS, "decisions.parquet")
    return document_of(
        study.config,
        summary,
        _remarks(study, "summary"),
        decisions=decisions,
        generated=study.generated,
    )


def sweep_document(study: FinishedStudy) -> Document:
    """The document of a sweep of thresholds.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    (summary,) = study.rows
    study.require_keys(summary, SUMMARY_KEYS, "summary.json")
    pairs = study.table("table3")
    study.require_keys(pairs, ("h_pct", "m_pct", "score"), "table3.parquet")
    base = json.loads(study.metadata("table3").get("base", "{}"))
    return sweep_document_of(study.config, pairs, summary, base, generated=study.generated)


def paper_document(study: FinishedStudy) -> Document:
    """The document of a study that is compared with the paper.

    Raises:
        FileNotFoundError, ValueError: The table is missing, or of an older version.
    """
    (summary,) = study.rows
    form = import_module(study.task.run.partition(":")[0]).FORM
    table, remarks = study.table(form.name), _remarks(study, form.name)
    study.require_keys(table, ("row", "metric", "ours"), f"{form.name}.parquet")
    return study_document_of(form, study.config, table, summary, remarks, generated=study.generated)


def real_document(study: FinishedStudy) -> Document:
    """The document of a study of real recordings.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    table, facts, differences = (study.table(name) for name in ("real", "facts", "differences"))
    study.require_keys(table, ROW_COLUMNS, "real.parquet")
    study.require_keys(facts, FACT_COLUMNS, "facts.parquet")
    return real_document_of(table, facts, differences, _remarks(study, "real"), generated=study.generated)


def budget_document(study: FinishedStudy) -> Document:
    """The document of an error budget.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    table, steps = study.table("budget"), study.table("steps")
    study.require_keys(table, BUDGET_COLUMNS, "budget.parquet")
    study.require_keys(steps, STEP_COLUMNS, "steps.parquet")
    return budget_document_of(table, steps, _remarks(study, "budget"), generated=study.generated)


def stability_document(study: FinishedStudy) -> Document:
    """The document of a study of stability.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    tables = {name: study.table(name) for name in STABILITY_TABLES}
    study.require_keys(tables["ring"], RING_COLUMNS, "ring.parquet")
    verdict = json.loads((study.path / "verdict.json").read_text(encoding="utf-8"))
    margin = study.config.stability.margin
    return stability_document_of(tables, verdict, _remarks(study, "ring"), margin=margin, generated=study.generated)


def _remarks(study: FinishedStudy, table: str) -> Remarks:
    """Remarks on a table; empty in studies of an older version."""
    remarks = study.metadata(table).get("remarks")
    return Remarks() if remarks is None else Remarks.from_json(remarks)


DOCUMENTS: dict[str, Callable[[FinishedStudy], Document]] = {
    "evaluate": evaluation_document,
    "discover": discovery_document,
    "discover blind": blind_document,
    "sweep thresholds": sweep_document,
    "study real": real_document,
    "study budget": budget_document,
    "study stability": stability_document,
    **{f"study {name}": paper_document for name in ("table1", "table3", "table4", "fig6", "fig7", "fig8")},
}
"""The document of a study, by the task that made it."""

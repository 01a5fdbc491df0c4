"""The document of a finished study, by the task that made it.

All functions raise FileNotFoundError or ValueError if a file is missing, or of an older version.
"""

import json
from collections.abc import Callable
from importlib import import_module

from rearl_jax.blind import document as blind
from rearl_jax.discovery.report import document as discovery
from rearl_jax.document.document import Document
from rearl_jax.evaluation.document import DECISION_COLUMNS, SUMMARY_COLUMNS, document_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.study.budget.document import document_of as budget_document_of
from rearl_jax.study.budget.tables import BUDGET_COLUMNS, STEP_COLUMNS
from rearl_jax.study.document import document_of as study_document_of
from rearl_jax.study.real.document import document_of as real_document_of
from rearl_jax.study.real.facts import FACT_COLUMNS
from rearl_jax.study.real.table import ROW_COLUMNS
from rearl_jax.study.stability.document import TABLES as STABILITY_TABLES
from rearl_jax.study.stability.document import VERDICT_COLUMNS
from rearl_jax.study.stability.document import document_of as stability_document_of
from rearl_jax.study.stability.rings import RING_COLUMNS
from rearl_jax.sweep.document import SUMMARY_KEYS
from rearl_jax.sweep.document import document_of as sweep_document_of

_VERDICT_KEYS = ("verdict", "effects", "candidates", "unseen", "error", "adequacy", "lane_choice", "data")
"""Required keys of verdict.json of a discovery."""

_MAP_COLUMNS = ("model", "variable", "acts_on", "share", "gain", "selected", "shape")
"""Required columns of maps.parquet; a map is the unexplained acceleration as a function of one variable."""

_PROTOCOL_KEYS = ("code_hash", "seed_drawn", "master_seed", "truth_sha256")
"""Required keys of protocol.json of a blind study, in which discovery is not told what effects are hidden."""

_BLIND_KEYS = ("n_right", "n_cases", "n_drawn", "oracle_share", "n_oracles", "median_seconds")
"""Required keys of summary.json of a blind study."""


def evaluation_document(study: FinishedStudy) -> Document:
    """The document of an evaluation."""
    summary, remarks = study.table("summary", SUMMARY_COLUMNS), _remarks(study, "summary")
    decisions = study.table("decisions", DECISION_COLUMNS) if study.has_table("decisions") else None
    return document_of(study.config, summary, remarks, decisions=decisions, generated=study.generated)


def discovery_document(study: FinishedStudy) -> Document:
    """The document of a discovery."""
    verdict = study.object("verdict.json", _VERDICT_KEYS)
    # Maps are not written if discover.page is false.
    maps = study.table("maps", _MAP_COLUMNS) if study.has_table("maps") else None
    return discovery.document_of(study.config, verdict, maps)


def blind_document(study: FinishedStudy) -> Document:
    """The document of a blind study."""
    summary, protocol = study.summary(_BLIND_KEYS), study.object("protocol.json", _PROTOCOL_KEYS)
    # The table of strata is written for studies with broad priors only.
    written = [name for name in blind.TABLES if name != blind.STRATA or summary.get(blind.STRATA)]
    return blind.document_of(summary, {name: study.table(name) for name in written}, protocol)


def sweep_document(study: FinishedStudy) -> Document:
    """The document of a sweep of thresholds."""
    summary, pairs = study.summary(SUMMARY_KEYS), study.table("table3", ("h_pct", "m_pct", "score"))
    base = json.loads(study.metadata("table3").get("base", "{}"))
    return sweep_document_of(study.config, pairs, summary, base, generated=study.generated)


def paper_document(study: FinishedStudy) -> Document:
    """The document of a study that is compared with the paper."""
    form = import_module(study.task.run.partition(":")[0]).FORM
    table, remarks = study.table(form.name, ("row", "metric", "ours")), _remarks(study, form.name)
    return study_document_of(form, study.config, table, study.summary(), remarks, generated=study.generated)


def real_document(study: FinishedStudy) -> Document:
    """The document of a study of real recordings."""
    table, facts = study.table("real", ROW_COLUMNS), study.table("facts", FACT_COLUMNS)
    differences = study.table("differences")
    return real_document_of(table, facts, differences, _remarks(study, "real"), generated=study.generated)


def budget_document(study: FinishedStudy) -> Document:
    """The document of an error budget."""
    table, steps = study.table("budget", BUDGET_COLUMNS), study.table("steps", STEP_COLUMNS)
    return budget_document_of(table, steps, _remarks(study, "budget"), generated=study.generated)


def stability_document(study: FinishedStudy) -> Document:
    """The document of a study of stability."""
    tables = {name: study.table(name, RING_COLUMNS if name == "ring" else ()) for name in STABILITY_TABLES}
    verdict = study.objects("verdict.json", tuple(VERDICT_COLUMNS))
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

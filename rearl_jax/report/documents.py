"""The document of a finished study, by the task that made it."""

from collections.abc import Callable

from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Cell, Emphasis, Row, Table
from rearl_jax.evaluation.document import DECISION_COLUMNS, SUMMARY_COLUMNS, document_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.report.content import Content
from rearl_jax.report.discovery import blind_document, discovery_document
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.report.others import paper_content, sweep_content
from rearl_jax.study.report import Shown


def evaluation_document(study: FinishedStudy) -> Document:
    """The document of an evaluation.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    summary, remarks = study.table("summary"), study.metadata("summary").get("remarks")
    study.needs(summary, SUMMARY_COLUMNS, "summary.parquet")
    decisions = None
    if (study.path / "decisions.parquet").exists():
        decisions = study.table("decisions")
        study.needs(decisions, DECISION_COLUMNS, "decisions.parquet")
    return document_of(
        study.config,
        summary,
        Remarks() if remarks is None else Remarks.from_json(remarks),
        decisions=decisions,
        generated=study.generated,
    )


def _from_content(content_of: Callable[[FinishedStudy], Content]) -> Callable[[FinishedStudy], Document]:
    def document(study: FinishedStudy) -> Document:
        content = content_of(study)
        sections = (
            Section(part.title, part.paragraphs, tuple(map(_table, part.tables)), part.items, part.is_folded)
            for part in content.sections
        )
        data = " ".join(filter(None, (content.data, *content.notes)))
        return Document(
            content.title,
            content.result,
            tuple(sections),
            content.words,
            study.generated,
            data,
            captions=content.captions,
        )

    return document


def _table(shown: Shown) -> Table:
    rows = (
        Row(
            line.title,
            tuple(Cell(cell.figure, cell.interval) for cell in line.cells),
            Emphasis.subdued if line.is_paper else Emphasis.plain,
        )
        for line in shown.lines
    )
    return Table(shown.title, shown.headings, tuple(rows))


DOCUMENTS: dict[str, Callable[[FinishedStudy], Document]] = {
    "evaluate": evaluation_document,
    "discover": discovery_document,
    "discover blind": blind_document,
    "sweep thresholds": _from_content(sweep_content),
    **{
        f"study {name}": _from_content(paper_content) for name in ("table1", "table3", "table4", "fig6", "fig7", "fig8")
    },
}
"""The document of a study, by the task that made it."""

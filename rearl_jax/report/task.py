"""The task `rearl report`: the folder of a finished study in, one HTML file out.

Nothing of the study is changed. Of `rearl evaluate` some scenes are simulated again for the replay; where that cannot
be done the file is written without them and says why.
"""

import logging
from collections.abc import Callable
from pathlib import Path

from rearl_jax.config import ReportTask
from rearl_jax.document.document import Document
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import progress_bar
from rearl_jax.report.content import Content, Section
from rearl_jax.report.discovery import blind_document, discovery_document
from rearl_jax.report.finished import FinishedStudy, read_finished
from rearl_jax.report.methods import evaluation_content
from rearl_jax.report.others import paper_content, sweep_content
from rearl_jax.report.page import write_report
from rearl_jax.report.replay import NoReplayError, Replay, simulate_again
from rearl_jax.study.report import Cell, Line, Shown
from rearl_jax.whole_files import replacing

log = logging.getLogger(__name__)

FILE = "report.html"


def _content(document_of: Callable[[FinishedStudy], Document]) -> Callable[[FinishedStudy], Content]:
    def content(study: FinishedStudy) -> Content:
        document = document_of(study)
        sections = []
        for part in document.sections:
            tables = tuple(
                Shown(
                    table.title,
                    table.headings,
                    tuple(Line(row.title, tuple(Cell(c.value, c.interval) for c in row.cells)) for row in table.rows),
                )
                for table in part.tables
            )
            sections.append(Section(part.title, part.paragraphs, tables, part.notes, part.is_folded))
        return Content(
            document.title,
            document.verdict,
            tuple(sections),
            document.data,
            document.command,
            captions=document.captions,
        )

    return content


_CONTENTS: dict[str, Callable[[FinishedStudy], Content]] = {
    "evaluate": evaluation_content,
    "discover": _content(discovery_document),
    "discover blind": _content(blind_document),
    "sweep thresholds": sweep_content,
    **{f"study {name}": paper_content for name in ("table1", "table3", "table4", "fig6", "fig7", "fig8")},
}
"""What is said about a study, by the task that made it."""


def run(config: ReportTask) -> dict:
    """`path` of the file, its `size` [bytes], `scenes` that are replayed in it, and why there are none: `no_replay`.

    Raises:
        FileNotFoundError: There is no such study, it is not finished, or a file of it is missing.
        ValueError: It is of another version or of a task without reports, or scenes asked for are none of it.
    """
    study = read_finished(config.results.root, config.study)
    words = study.task.words
    if words not in _CONTENTS:
        said = f"must be of {', '.join(_CONTENTS)}, on which there are reports; it is of `rearl {words}`"
        raise InvalidInputError(Problem("no-report", said, key="study", value=config.study))
    content = _CONTENTS[words](study)
    replay, no_replay = _replay(study, config)
    path = Path(config.report.path) if config.report.path else study.path / FILE
    text = write_report(study, content, replay, no_replay).encode("utf-8")
    with replacing(path) as unfinished:
        unfinished.write_bytes(text)
    scenes = [] if replay is None else [int(replay.scenes.scene_id[one.index]) for one in replay.replayed]
    print(content.result)
    if no_replay:
        print(no_replay)
    print(f"report: {path} ({len(text) / 1000:.0f} kB{', scenes ' + ', '.join(map(str, scenes)) if scenes else ''})")
    return {"path": str(path), "size": len(text), "scenes": scenes, "no_replay": no_replay}


def _replay(study: FinishedStudy, config: ReportTask) -> tuple[Replay | None, str]:
    """The scenes that are shown, else why there are none."""
    if study.task.words != "evaluate" or not config.report.replay:
        rows = study.path / "rows"
        where = f"Scenes are replayed in the reports on its rows: rearl report study={config.study}/rows/ROW."
        return None, where if config.report.replay and rows.is_dir() else ""
    with progress_bar() as bar:
        try:
            return simulate_again(study, config.report, bar), ""
        except NoReplayError as error:
            log.warning("no replay: %s", error)
            return None, f"No scenes are replayed here: {error}."

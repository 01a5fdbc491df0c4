"""The task `rearl report`: writes the page of a finished study again.

Nothing else of the study is changed. Of `rearl evaluate` some scenes are simulated again for the replay; if that is
impossible, the page is written without them and states why.
"""

import logging
from dataclasses import replace
from pathlib import Path

from rearl_jax.code_version import code_hash
from rearl_jax.config import ReportTask
from rearl_jax.document.document import Document, Section
from rearl_jax.document.html import page_of
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import progress_bar
from rearl_jax.replay.player import player_of
from rearl_jax.replay.scenes import Replay
from rearl_jax.report.documents import DOCUMENTS
from rearl_jax.report.finished import FinishedStudy, read_finished
from rearl_jax.report.replay import NoReplayError, simulate_again
from rearl_jax.whole_files import replacing

log = logging.getLogger(__name__)

FILE = "page.html"

_NEW_KEYS = "Keys that did not exist when the study was made are listed with their defaults."


def run(config: ReportTask) -> dict:
    """`path` of the file, its `size` [bytes], `scenes` that are replayed in it, and why there are none: `no_replay`.

    Raises:
        FileNotFoundError: There is no such study, it is not finished, or a file of it is missing.
        ValueError: The study has another version or a task without reports, or requested scenes do not belong to it.
    """
    study = read_finished(config.results.root, config.study)
    words = study.task.words
    if words not in DOCUMENTS:
        message = f"must be of {', '.join(DOCUMENTS)}, on which there are reports; it is of `rearl {words}`"
        raise InvalidInputError(Problem("no-report", message, key="study", value=config.study))
    document = _completed(_document(study), study)
    replay, no_replay = _replay(study, config)
    if no_replay:
        document = replace(document, sections=(*document.sections, Section("Scenes replayed", (no_replay,))))
    player = None if replay is None else player_of(replay)
    page = page_of(document, study.config, study.figures, made_by=study.provenance, player=player).encode("utf-8")
    path = Path(config.report.path) if config.report.path else study.path / FILE
    with replacing(path) as unfinished:
        unfinished.write_bytes(page)
    scenes = [] if replay is None else [int(replay.scenes.scene_id[scene.index]) for scene in replay.replayed]
    print(document.verdict)
    if no_replay:
        print(no_replay)
    print(f"report: {path} ({len(page) / 1000:.0f} kB{', scenes ' + ', '.join(map(str, scenes)) if scenes else ''})")
    return {"path": str(path), "size": len(page), "scenes": scenes, "no_replay": no_replay}


def _document(study: FinishedStudy) -> Document:
    """The document of a study.

    Raises:
        ValueError: Other code wrote its figures under other names.
    """
    try:
        return DOCUMENTS[study.task.words](study)
    except KeyError as error:
        if study.provenance["code_hash"] == code_hash():
            raise
        message = f"has no {error}: other code ({study.provenance['code_version']}) wrote the study"
        raise InvalidInputError(Problem("key-missing", message, study.remedy, file=str(study.path))) from error


def _completed(document: Document, study: FinishedStudy) -> Document:
    """The document, with the licence of the recordings added if it is missing, and notes on what is unknown."""
    sources, data = document.sources, [document.data]
    if not sources:
        try:
            sources = study.sources
        except (OSError, ValueError) as error:
            data.append(f"Source and licence of the recordings are unknown: {error}.")
    if study.has_new_keys:
        data.append(_NEW_KEYS)
    return replace(document, sources=sources, data=" ".join(filter(None, data)))


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

"""The HTML file: content, figures, replay and provenance in the layout that all pages share."""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.evaluation.layout import data_sources, render_page
from rearl_jax.evaluation.scores import title_of
from rearl_jax.report.content import Content, spoken
from rearl_jax.report.embedding import embedded, replay_data
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.report.replay import Replay

_NEW_KEYS = "Keys that did not exist when the study was made are listed with their defaults."


def write_report(study: FinishedStudy, content: Content, replay: Replay | None, no_replay: str) -> str:
    """HTML text; nothing in it is loaded from anywhere else.

    Args:
        study: The study.
        content: What is said about it.
        replay: Scenes that are shown; None for none.
        no_replay: Why there are none, empty where nobody would look for them.
    """
    sources, unknown = _sources(study, replay)
    notes = (*content.notes, *unknown, *([_NEW_KEYS] if study.has_new_keys else []))
    figures = study.figures(content.captions)
    played = None if replay is None else replay_data(replay)
    return render_page(
        "page.html.j2",
        package="rearl_jax.report",
        words=content.words,
        config=study.config,
        figures=figures,
        captions={name: content.captions.get(name, spoken(name)) for name in figures},
        made_by=study.provenance,
        title=content.title,
        generated=study.generated,
        result=content.result,
        sections=content.sections,
        data={"summary": " ".join((content.data, *notes)), "sources": sources},
        replay=None if played is None else embedded(played),
        replay_words="" if replay is None or played is None else _replay_words(replay, played),
        replay_speed="" if replay is None or _is_as_recorded(replay) else ", rescaled as it is compared",
        no_replay=no_replay,
        player=_text("player.js"),
        player_style=_text("player.css"),
    )


def _text(name: str) -> str:
    return files("rearl_jax.report").joinpath(name).read_text(encoding="utf-8")


def _sources(study: FinishedStudy, replay: Replay | None) -> tuple[Sequence[Mapping[str, object]], list[str]]:
    """Data sets with their licence, and why they are not known where they are not."""
    if replay is not None:
        return data_sources(replay.scenes.infos), []
    if not hasattr(study.config, "data"):
        return [], []
    try:
        first = next(iterate_recordings(study.config.data))
    except (OSError, ValueError) as error:
        return [], [f"Source and licence of the recordings cannot be told: {error}."]
    return data_sources([first.info]), []


def _is_as_recorded(replay: Replay) -> bool:
    return replay.config.speed.norm is SpeedNorm.none


def _replay_words(replay: Replay, played: Mapping[str, Any]) -> str:
    """What must be known to read the replay."""
    n_left_out = len(replay.replayed) - len(played["scenes"])
    run, config = replay.replayed[0].run, replay.config
    parts = [
        f"Simulated again with {title_of(replay.row)}, eval.seed={config.eval.seed}, run {run} of {config.eval.n_runs} "
        "(from 0), and found to be the rollouts of the study: their Hellinger distances are those in runs.parquet.",
        "Both are drawn to one scale, all driving to the right, left lane on top; in the whole stretch vehicles are "
        "enlarged and lanes widened, in the close-up both are to scale. The picture follows the traffic; between two "
        "seconds vehicles move in straight lines. Every vehicle is drawn 2 m wide.",
        "Recorded are the vehicles of the scene, those picked in each second; they appear and leave as they were "
        "picked, in the middle of their lanes, at the speeds they drove.",
    ]
    if not _is_as_recorded(replay):
        parts.append(
            f"Speeds are compared rescaled (speed.norm={config.speed.norm.name}), so the recorded strip may move at "
            "another pace than the simulated one that resembles it."
        )
    if n_left_out:
        parts.append(f"{n_left_out} more scenes were left out to keep the file small.")
    return " ".join(parts)

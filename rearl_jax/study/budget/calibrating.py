"""Calibrated drivers of the budget: those of a given model, or calibrated on what the judged scenes leave."""

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.config import DiscoverTask
from rearl_jax.config.budget import StudyBudgetTask
from rearl_jax.data.checks.losses import split_tracks
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.discovery.calibration import Calibration, calibration
from rearl_jax.models.file import model_id, read_model
from rearl_jax.models.record import RepairedModel
from rearl_jax.problems import InvalidInputError
from rearl_jax.results import Study

log = logging.getLogger(__name__)

MODEL, ORIGIN = "model.yaml", "model.txt"
"""Files of a calibration of the study's own: the drivers, and on what they were calibrated."""


@dataclass(frozen=True)
class Drivers:
    """Calibrated drivers.

    Attributes:
        model: The drivers with all that belongs to them; None if there are none.
        origin: Where they come from, or why there are none, in a sentence.
    """

    model: RepairedModel | None
    origin: str


def calibrated_drivers(config: StudyBudgetTask, study: Study, scenes: SceneSet, held_out: np.ndarray) -> Drivers:
    """The drivers of `model`; without it those calibrated for this study, read from its folder if they were before.

    Args:
        config: The task.
        study: Folder in which the calibrated drivers are kept.
        scenes: All scenes.
        held_out: Indices of the judged scenes.

    Raises:
        FileNotFoundError, ValueError: The model cannot be read.
    """
    if config.model is not None:
        model = read_model(config.model)
        return Drivers(model, _given(config, model))
    if not config.budget.calibrate:
        return Drivers(None, "no model is given, and budget.calibrate is false")
    if not (study.path / MODEL).exists():
        try:
            model, origin = _calibrated(config, scenes, held_out)
        except InvalidInputError as error:
            return Drivers(None, f"drivers cannot be calibrated: {error}")
        study.write_text(ORIGIN, origin)
        model.save(study.own(MODEL))
    return Drivers(read_model(study.path / MODEL), (study.path / ORIGIN).read_text(encoding="utf-8"))


def _given(config: StudyBudgetTask, model: RepairedModel) -> str:
    """Sentence on the origin of the drivers of a given model, and on whether they have seen the judged scenes."""
    origin = f"drivers of {model.source.study} ({model_id(str(config.model))}), calibrated on {model.source.data_id}"
    if model.source.data_id == data_id(config.data):
        return (
            f"{origin}: these recordings, the judged scenes included. Name different recordings with data.recordings "
            "for discovery and for the budget to keep them apart"
        )
    return f"{origin}, which are not the recordings of the judged scenes as they are read here"


def _calibrated(config: StudyBudgetTask, scenes: SceneSet, held_out: np.ndarray) -> tuple[Calibration, str]:
    """A calibration, and on what."""
    task = DiscoverTask(study=config.study, results=config.results, data=config.data, discover=config.discover)
    try:
        found = calibration(task, outside(iterate_recordings(config.data), scenes, held_out))
        origin = (
            f"{len(found.drivers)} drivers were calibrated on the recordings outside the seconds of the judged scenes"
        )
    except InvalidInputError as error:
        log.info("outside the judged scenes: %s", error)
        found = calibration(task)
        origin = (
            f"{len(found.drivers)} drivers were calibrated on the whole recordings, the judged scenes included, "
            f"because outside them too little is left ({error.code})"
        )
    return found, origin


def outside(recordings: Iterable[Recording], scenes: SceneSet, held_out: np.ndarray) -> Iterator[Recording]:
    """The recordings without the seconds of some scenes, in which tracks are cut; those left without rows are left out.

    Args:
        recordings: The recordings.
        scenes: All scenes.
        held_out: Indices of the scenes to leave out.
    """
    for recording in recordings:
        frame = recording.table["frame"].to_numpy(np.int64)
        is_judged = np.zeros(len(frame), bool)
        for scene in held_out[scenes.recording[held_out] == recording.info.id]:
            first = int(scenes.start_frame[scene])
            is_judged |= (frame >= first) & (frame < first + round(scenes.seconds * float(scenes.frame_rate[scene])))
        if is_judged.all():
            continue
        kept = np.flatnonzero(~is_judged)
        table = recording.table.iloc[kept].reset_index(drop=True)
        track = table["track_id"].to_numpy()
        is_cut = np.zeros(len(kept), bool)
        is_cut[1:] = (np.diff(kept) > 1) & (track[1:] == track[:-1])
        yield replace(recording, table=split_tracks(table, is_cut).reset_index(drop=True))

"""Calibrated drivers of the budget: those of a given model, or calibrated outside the scenes that the budget judges."""

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax._typing import SceneIndices
from rearl_jax.config import DiscoverTask
from rearl_jax.config.budget import StudyBudgetTask
from rearl_jax.data.checks.losses import split_tracks
from rearl_jax.data.recordings import data_id
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.discovery.calibration import Calibration, calibration
from rearl_jax.discovery.observe.parts import labelled_recordings
from rearl_jax.models.file import model_id, read_model
from rearl_jax.models.record import RepairedModel
from rearl_jax.problems import InvalidInputError
from rearl_jax.results import Study
from rearl_jax.runtime import double_precision

log = logging.getLogger(__name__)

MODEL_FILE, ORIGIN_FILE = "model.yaml", "model.txt"
"""Files of drivers calibrated for this study, and of a sentence on the recordings behind them."""


@dataclass(frozen=True)
class Drivers:
    """Calibrated drivers.

    Attributes:
        model: Drivers, effects, noise and lane changes; None without drivers.
        origin: Sentence on their origin, or on why there are none.
    """

    model: RepairedModel | None
    origin: str


def calibrated_drivers(config: StudyBudgetTask, study: Study, scenes: SceneSet, held_out: SceneIndices) -> Drivers:
    """The drivers of the key `model`; without it drivers calibrated for this study, or read from its folder.

    Args:
        config: The task.
        study: Folder in which the calibrated drivers are kept.
        scenes: All scenes.
        held_out: Indices of the scored scenes.

    Raises:
        FileNotFoundError, ValueError: The model cannot be read.
    """
    if config.model is not None:
        model = read_model(config.model)
        return Drivers(model, _origin_of_model(config, model))
    if not config.budget.calibrate:
        return Drivers(None, "no model is given, and budget.calibrate is false")
    if not (study.path / MODEL_FILE).exists():
        try:
            with double_precision():  # as `rearl discover` calibrates, whatever the precision of the simulation
                model, origin = _calibrated(config, scenes, held_out)
        except InvalidInputError as error:
            return Drivers(None, f"drivers cannot be calibrated: {error}")
        study.write_text(ORIGIN_FILE, origin)
        model.save(study.recorded_path(MODEL_FILE))
    return Drivers(read_model(study.path / MODEL_FILE), (study.path / ORIGIN_FILE).read_text(encoding="utf-8"))


def _origin_of_model(config: StudyBudgetTask, model: RepairedModel) -> str:
    """Sentence on the origin of a model's drivers, and on whether the scored scenes were used to calibrate them."""
    origin = f"drivers of {model.source.study} ({model_id(str(config.model))}), calibrated on {model.source.data_id}"
    if model.source.data_id == data_id(config.data):
        return (
            f"{origin}: these recordings, the scored scenes included. Name different recordings with data.recordings "
            "for discovery and for the budget to keep them apart"
        )
    return f"{origin}, which are not the recordings of the scored scenes as they are read here"


def _calibrated(config: StudyBudgetTask, scenes: SceneSet, held_out: SceneIndices) -> tuple[Calibration, str]:
    """A calibration, and a sentence on the recordings behind it."""
    task = DiscoverTask(study=config.study, results=config.results, data=config.data, discover=config.discover)
    recordings = labelled_recordings(config.data, config.discover)
    try:
        result = calibration(task, without_scenes(recordings, scenes, held_out))
        origin = (
            f"{len(result.drivers)} drivers were calibrated on the recordings outside the seconds of the scored scenes"
        )
    except InvalidInputError as error:
        if error.code != "nobody-follows":
            raise
        log.info("outside the scored scenes: %s", error)
        result = calibration(task)
        origin = (
            f"{len(result.drivers)} drivers were calibrated on the whole recordings, the scored scenes included, "
            "because outside them nobody follows a leader long enough"
        )
    return result, origin


def without_scenes(recordings: Iterable[Recording], scenes: SceneSet, held_out: SceneIndices) -> Iterator[Recording]:
    """The recordings without the seconds of the scenes with these indices; tracks are split there, recordings without
    rows are left out.
    """
    for recording in recordings:
        frame = recording.table["frame"].to_numpy(np.int64)
        is_scored = np.zeros(len(frame), bool)
        for scene in held_out[scenes.recording[held_out] == recording.info.id]:
            first = int(scenes.start_frame[scene])
            is_scored |= (frame >= first) & (frame < first + round(scenes.seconds * float(scenes.frame_rate[scene])))
        if is_scored.all():
            continue
        kept = np.flatnonzero(~is_scored)
        table = recording.table.iloc[kept].reset_index(drop=True)
        track = table["track_id"].to_numpy()
        is_cut = np.zeros(len(kept), bool)
        is_cut[1:] = (np.diff(kept) > 1) & (track[1:] == track[:-1])
        yield replace(recording, table=split_tracks(table, is_cut).reset_index(drop=True))

"""Input of a study from recordings: scenes, their splits, and representative scenes (centres of clusters).

Scenes that were cut before are read from disk. A process remembers the last data set, so that the jobs of one study
read it once.
"""

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Int
from rich.progress import Progress

from rearl_jax.config import ClusterTask, EvaluateTask
from rearl_jax.config.evaluation import EvaluationConfig, Subset
from rearl_jax.data.recordings import count_recordings, file_stamps, iterate_recordings
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.scene_cache import SceneCache
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.splits import Split, Splits, split_for_evaluation, split_scenes
from rearl_jax.detection.references import References
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study

if TYPE_CHECKING:
    from rearl_jax.clustering.references import Clusters, ReferenceBuilder
    from rearl_jax.clustering.tracks import TrackSet

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs:
    """Input of a study.

    Attributes:
        scenes: All scenes.
        splits: The split of each scene: what the scene is used for.
        references: Representative scenes; None if they were not needed.
        clusters: The clusterings whose centres are the references.
    """

    scenes: SceneSet
    splits: Splits
    references: References | None = None
    clusters: "Clusters | None" = None

    def held_out(self, eval: EvaluationConfig) -> Int[np.ndarray, " scenes"]:
        """Indices of the scenes to evaluate on, those of `eval.subset`."""
        return self.splits.indices(Split[eval.subset.name.upper()])


def inputs_of_scenes(config: EvaluateTask, scenes: SceneSet) -> Inputs:
    """Input of a study whose scenes are given.

    Raises:
        InvalidInputError: There are too few scenes, or the method needs representative scenes. These cannot be found
            here, because the clustering uses whole tracks.
    """
    if config.method.needs_references:
        message = "needs representative scenes, which are clustered from whole recordings"
        remedy = "give a table of trajectories instead of scenes, or name the recordings with data"
        raise InvalidInputError(Problem("recordings-needed", message, remedy, key="method", value=config.method.name))
    return Inputs(scenes, splits_for(config, scenes))


def splits_for(config: EvaluateTask | ClusterTask, scenes: SceneSet) -> Splits:
    """Splits of the scenes. A method that uses no scenes besides the evaluated ones gets only evaluation scenes.

    Raises:
        InvalidInputError: There are too few scenes.
    """
    if isinstance(config, EvaluateTask) and config.eval.subset is Subset.evaluation and not config.method.needs_splits:
        return split_for_evaluation(scenes, config.split)
    return split_scenes(scenes, config.split)


def read_inputs(
    config: EvaluateTask | ClusterTask, study: Study | None, bar: Progress, *, with_references: bool
) -> Inputs:
    """Scenes, splits and, if needed, representative scenes.

    Args:
        config: The task.
        study: Folder that keeps the steps of a search for the clusters' parameters; None to keep nothing.
        bar: Progress bar, which shows how many recordings were read.
        with_references: Whether representative scenes are needed.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, one is bad, or too few scenes can be cut from them.
    """
    builder = None
    key = _key(config)
    last_read = _LAST_READ.get(key)
    if with_references:
        # Imported here, because scikit-learn is slow to import and the method `base` does not need it.
        from rearl_jax.clustering.references import ReferenceBuilder

        builder = ReferenceBuilder(config, None if last_read is None else last_read.tracks)
    scenes = None if last_read is None else last_read.scenes
    if scenes is None or (builder is not None and builder.needs_recordings):
        scenes = _read(config, builder, bar)
    splits = splits_for(config, scenes)
    log.info("splits: %s", ", ".join(f"{name} {size}" for name, size in splits.summary().items()))
    inputs = Inputs(scenes, splits)
    if builder is not None:
        inputs = Inputs(scenes, splits, *builder.build(scenes, splits, study))
    tracks = builder.tracks if builder is not None else last_read.tracks if last_read is not None else None
    _LAST_READ.clear()
    _LAST_READ[key] = _Read(scenes, tracks)
    return inputs


@dataclass(frozen=True)
class _Read:
    scenes: SceneSet
    tracks: "TrackSet | None"


_LAST_READ: dict[tuple, _Read] = {}
"""The last data set read, by files and configuration; one at most, as it may be large."""


def _key(config: EvaluateTask | ClusterTask) -> tuple:
    groups = (config.data, config.scenes, config.speed, config.tracks, config.features, config.spacing)
    return (*groups, *file_stamps(config.data))


def _read(config: EvaluateTask | ClusterTask, builder: "ReferenceBuilder | None", bar: Progress) -> SceneSet:
    """Scenes from disk or, if they or the tracks are missing there, from the recordings."""
    cache = SceneCache(config.data, config)
    needs_recordings = builder is not None and builder.needs_recordings
    scenes = None if needs_recordings else cache.read()
    if scenes is not None:
        log.info("%d scenes of %d windows, cut before", len(scenes), scenes.counts.windows)
        return scenes
    reading = bar.add_task("recordings", total=count_recordings(config.data))
    recordings = iterate_recordings(config.data)
    if builder is not None:
        recordings = builder.passing(recordings)
    scenes = build_scenes(recordings, config, progress=lambda name, n_scenes: bar.advance(reading))
    cache.write(scenes)
    return scenes

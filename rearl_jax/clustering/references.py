"""Representative scenes from recordings in one pass; detection compares simulated traffic with them.

    builder = ReferenceBuilder(config)
    scenes = build_scenes(builder.passing(iterate_recordings(config.data)), ...)
    references, clusters = builder.build(scenes, split_scenes(scenes, config.split))

Finished clusterings are stored on disk; if one is found, no tracks are collected.
"""

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import pandas as pd
from jaxtyping import Float, Float32, Int, Shaped

from rearl_jax.cache import kept_path, read_arrays, write_arrays
from rearl_jax.clustering.kl import Curves, cluster_curves
from rearl_jax.clustering.scenes import SceneClusters, cluster_scenes, label_shares, may_be_fitted, references_of
from rearl_jax.clustering.search import search
from rearl_jax.clustering.tracks import FeatureScale, TrackCollector, TrackSet, picked_in, track_index
from rearl_jax.config._schema import as_plain
from rearl_jax.config.clustering import BoConfig, ClusterConfig, FitOn, KlConfig
from rearl_jax.config.data import DataConfig
from rearl_jax.config.scenes import SplitConfig
from rearl_jax.data.recordings import data_id, file_stamps
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import SceneKeys
from rearl_jax.data.scenes.splits import Splits
from rearl_jax.detection.references import References
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study

log = logging.getLogger(__name__)

N_DRAWN_TRACKS = 600
"""Number of tracks whose curves are kept for figures."""


@runtime_checkable
class ReferenceKeys(SceneKeys, Protocol):
    """Groups of a task's configuration that determine its references."""

    data: DataConfig
    split: SplitConfig
    kl: KlConfig
    cluster: ClusterConfig
    bo: BoConfig


_SOURCES = ("clustering", "config", "data", "metrics")
"""Parts of the package whose code determines a clustering."""

_GROUPS = ("tracks", "scenes", "speed", "features", "spacing", "split", "kl", "cluster", "bo")
"""Groups of configuration keys that determine a clustering."""


@dataclass(frozen=True)
class TrackClusters:
    """Clusters of tracks, ordered by the mean speed of their centres, slowest first.

    Attributes:
        recording: Recording of every track.
        track_id: Vehicle, unique in its recording.
        labels: Nearest centre.
        distances: Frechet distance to it, unitless.
        centres: Centres in units of the features: scaled speed [m/s], position [m], distance [m].
        counts: Numbers of excluded tracks: too short ones, and those never near another vehicle.
        fitted: Number of tracks the centres were fitted on.
        costs: Mean distance of these to their nearest centre, unitless: of the first centres, then after each update;
            the centres are those of the lowest cost.
        parameters: k, l and iterations the centres were made with.
        drawn: Index of some tracks, for figures.
        drawn_curves: Features of these tracks.
    """

    recording: Shaped[np.ndarray, " tracks"]
    track_id: Int[np.ndarray, " tracks"]
    labels: Int[np.ndarray, " tracks"]
    distances: Float32[np.ndarray, " tracks"]
    centres: Float[np.ndarray, "clusters features vertices"]
    counts: Int[np.ndarray, " 2"]
    fitted: Int[np.ndarray, ""]
    costs: Float[np.ndarray, " iterates"]
    parameters: Int[np.ndarray, " 3"]
    drawn: Int[np.ndarray, " drawn"]
    drawn_curves: Float32[np.ndarray, "features points drawn"]


@dataclass(frozen=True)
class Clusters:
    """Both clusterings behind the references.

    Attributes:
        scene_id: scene_id of every scene, to which the indices in `scenes` refer.
        tracks: Clusters of tracks.
        scenes: Clusters of scenes.
        trace: Rounds of the search for k, l and iterations; None if there is none.
    """

    scene_id: Int[np.ndarray, " scenes"]
    tracks: TrackClusters
    scenes: SceneClusters
    trace: pd.DataFrame | None

    @property
    def reference_scenes(self) -> Int[np.ndarray, " references"]:
        """scene_id of the representatives, in the order of the references."""
        return self.scene_id[self.scenes.representatives]


class ReferenceBuilder:
    """Collects tracks while scenes are cut, then builds the references; finished ones come from disk.

    Attributes:
        data_id: Identity of the data.
        tracks: Tracks of the data set; None until they are needed.
    """

    def __init__(self, config: ReferenceKeys, tracks: TrackSet | None = None) -> None:
        """Looks for a finished clustering of the same configuration, files and code.

        Args:
            config: A task's configuration.
            tracks: Tracks collected before, under the same configuration of data, tracks, scenes and features.
        """
        self._config, self.tracks = config, tracks
        keys = {group: as_plain(getattr(config, group)) for group in _GROUPS}
        del keys["scenes"]["boundary"]  # concerns simulations, not the recorded scenes
        self.data_id = data_id(config.data)
        stamps = [list(stamp) for stamp in file_stamps(config.data)]
        self._path = kept_path("clusters", {**keys, "data": self.data_id, "files": stamps}, _SOURCES, ".npz")
        self._finished = _stored(self._path)
        self._collector = TrackCollector(config)

    @property
    def needs_recordings(self) -> bool:
        """True if the recordings must be passed through: no finished clustering and no tracks are available."""
        return self._finished is None and self.tracks is None

    def passing(self, recordings: Iterable[Recording]) -> Iterator[Recording]:
        """The recordings, unchanged; their tracks are kept if they are needed."""
        return self._collector.passing(recordings) if self.needs_recordings else iter(recordings)

    def build(
        self,
        scenes: SceneSet,
        splits: Splits,
        study: Study | None = None,
        progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
    ) -> tuple[References, Clusters]:
        """Representative scenes and the clusterings behind them.

        Args:
            scenes: All scenes of the recordings passed.
            splits: Evaluation and tuning scenes.
            study: Stores the trace of a search, so that it can be resumed (`bo.enabled`).
            progress: Called with a stage (`search`, `tracks`), the steps done and their total.

        Raises:
            ValueError: Too few tracks or scenes to cluster, or the recordings have not been passed through.
        """
        clusters = self._finished
        if clusters is not None and not np.array_equal(clusters.scene_id, scenes.scene_id):
            message = f"the file belongs to {len(clusters.scene_id)} scenes, {len(scenes)} were given"
            remedy = "build references from the scenes of the same configuration"
            raise InvalidInputError(Problem("scenes-differ", message, remedy, file=str(self._path)))
        if clusters is None:
            self.tracks = self._collector.collected() if self.tracks is None else self.tracks
            clusters = cluster(self._config, scenes, self.tracks, splits, study, self.data_id, progress)
            write_arrays(self._path, _arrays(clusters))
        _warn_of_leaks(clusters, splits)
        return references_of(scenes, clusters.scenes, self._config.cluster), clusters


def cluster(
    config: ReferenceKeys,
    scenes: SceneSet,
    tracks: TrackSet,
    splits: Splits,
    study: Study | None,
    identity: str,
    progress: Callable[[str, int, int], None],
) -> Clusters:
    """Both clusterings, of tracks and then of scenes; arguments as in `ReferenceBuilder.build`.

    Raises:
        InvalidInputError: All tracks drive through scenes on which no clustering may be fitted.
    """
    allowed = may_be_fitted(splits, config.cluster.fit_on)
    # Vehicles of evaluation and tuning scenes must not influence the centres.
    training = ~picked_in(tracks, scenes, np.flatnonzero(~allowed))
    if not training.any():
        message = (
            f"all {len(tracks)} tracks drive through evaluation or tuning scenes, none is left to fit the clusters"
        )
        remedy = "read more recordings, set split.evaluation and split.tuning to smaller numbers, or cluster.fit_on=all"
        raise InvalidInputError(Problem("tracks-too-few", message, remedy))
    features = tracks.features(scenes)
    scale = FeatureScale.of(features[:, :, training], config.kl.weights)
    track_clusters, kl, trace = cluster_tracks(config, tracks, features, scale, training, study, identity, progress)
    track = track_index(tracks, scenes, np.arange(len(scenes)))
    labels = np.where(track >= 0, track_clusters.labels[track], -1)
    vectors = label_shares(labels, track, kl.k, config.cluster.vector)
    return Clusters(scenes.scene_id, track_clusters, cluster_scenes(vectors, allowed, config.cluster), trace)


def cluster_tracks(
    config: ReferenceKeys,
    tracks: TrackSet,
    features: Float32[np.ndarray, "features points tracks"],
    scale: FeatureScale,
    training: np.ndarray,
    study: Study | None,
    identity: str,
    progress: Callable[[str, int, int], None],
) -> tuple[TrackClusters, KlConfig, pd.DataFrame | None]:
    """Centres fitted on the training tracks, labels of all tracks; also the parameters used and the search's trace."""
    curves = scale.scaled(features)
    fitted = np.ascontiguousarray(curves[:, :, training])
    kl, trace = config.kl, None
    if config.bo.enabled:
        kl, trace = search(fitted, kl, config.bo, study, identity, lambda done, total: progress("search", done, total))
    training_curves = Curves(fitted, kl)
    best, costs = cluster_curves(training_curves, kl, lambda done, total: progress("tracks", done, total))
    # Slowest first, so that label 0 means the same in every run.
    physical = scale.physical(best.vertices)
    order = np.argsort(physical[:, 0].mean(axis=1), kind="stable")
    distances = training_curves.distances(best.vertices[order], curves)
    labels = distances.argmin(axis=0)
    drawn = np.sort(np.random.default_rng([kl.seed, 3]).permutation(len(tracks))[:N_DRAWN_TRACKS])
    log.info("tracks per cluster: %s; mean distance %.4f", np.bincount(labels, minlength=kl.k).tolist(), best.cost)
    return (
        TrackClusters(
            recording=tracks.recording,
            track_id=tracks.track_id,
            labels=labels,
            distances=distances.min(axis=0),
            centres=physical[order],
            counts=np.array([tracks.n_short, tracks.n_alone]),
            fitted=np.array(training.sum()),
            costs=np.array(costs),
            parameters=np.array([kl.k, kl.l, kl.iterations]),
            drawn=drawn,
            drawn_curves=features[:, :, drawn],
        ),
        kl,
        trace,
    )


def _warn_of_leaks(clusters: Clusters, splits: Splits) -> None:
    held_out = np.concatenate([splits.evaluation, splits.tuning])
    leaked = np.isin(clusters.scenes.representatives, held_out).sum()
    if leaked:
        log.warning(
            "%d references are evaluation or tuning scenes (cluster.fit_on=%s): results on these are not held out",
            int(leaked),
            FitOn.all.name,
        )


_TRACK_FIELDS = tuple(item.name for item in fields(TrackClusters))
_SCENE_FIELDS = tuple(item.name for item in fields(SceneClusters))


def _arrays(clusters: Clusters) -> dict[str, np.ndarray]:
    """The record as named arrays."""
    arrays = {"scene_id": clusters.scene_id}
    arrays |= {f"tracks.{name}": getattr(clusters.tracks, name) for name in _TRACK_FIELDS}
    arrays |= {f"scenes.{name}": np.asarray(getattr(clusters.scenes, name)) for name in _SCENE_FIELDS}
    if clusters.trace is not None:
        for name, column in clusters.trace.items():
            arrays[f"trace.{name}"] = column.to_numpy(np.str_ if name == "chosen_by" else None)
    return arrays


def _stored(path: Path) -> Clusters | None:
    """The record from disk; None if it is missing or damaged."""
    arrays = read_arrays(path)
    if arrays is None:
        return None
    trace = {name.removeprefix("trace."): values for name, values in arrays.items() if name.startswith("trace.")}
    try:
        n_distinct = int(arrays.pop("scenes.n_distinct"))
        by_scene = {name: arrays[f"scenes.{name}"] for name in _SCENE_FIELDS if name != "n_distinct"}
        return Clusters(
            scene_id=arrays["scene_id"],
            tracks=TrackClusters(**{name: arrays[f"tracks.{name}"] for name in _TRACK_FIELDS}),
            scenes=SceneClusters(**by_scene, n_distinct=n_distinct),
            trace=pd.DataFrame(trace) if trace else None,
        )
    except KeyError as error:
        log.warning("%s is damaged (it lacks %s): clusters are computed again", path, error)
        return None

"""Clustering of scenes by the kinds of tracks in them, with one representative per cluster."""

import logging
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.config.clustering import ClusterConfig, FitOn, Representative, SceneVector
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.splits import Split, Splits
from rearl_jax.decision.situation import N_ACTIONS
from rearl_jax.detection.references import References
from rearl_jax.problems import InvalidInputError, Problem

log = logging.getLogger(__name__)

_SHARE_DECIMALS = 9
"""Decimals to which shares must agree for scenes to count as equal; smaller differences are rounding errors."""


@dataclass(frozen=True)
class SceneClusters:
    """Clusters of scenes, ordered by their centres: the largest share of the slowest kind of track first.

    Attributes:
        vectors: Shares of the labels in every scene, summing to 1; zeros for a scene without labelled tracks.
        fitted: Scenes the clustering was fitted on.
        labels: Nearest centre of every scene; -1 for a scene without labelled tracks.
        centres: Centroids.
        representatives: Index of the fitted member nearest to each centroid.
        n_distinct: Number of different vectors among the fitted scenes.
    """

    vectors: Float[np.ndarray, "scenes shares"]
    fitted: Bool[np.ndarray, " scenes"]
    labels: Int[np.ndarray, " scenes"]
    centres: Float[np.ndarray, "clusters shares"]
    representatives: Int[np.ndarray, " clusters"]
    n_distinct: int

    def members(self, cluster: int) -> Int[np.ndarray, " members"]:
        """Indices of the fitted scenes of one cluster, in ascending order."""
        return np.flatnonzero(self.fitted & (self.labels == cluster))


def label_shares(
    labels: Int[np.ndarray, "scenes frames slots"],
    track: Int[np.ndarray, "scenes frames slots"],
    n_labels: int,
    definition: SceneVector,
) -> Float[np.ndarray, "scenes labels"]:
    """Share of every label in every scene.

    Args:
        labels: Label of the track in every slot; -1 if there is none.
        track: Index of that track, the same wherever it is seen.
        n_labels: Number of labels.
        definition: Every track of the scene once, or every slot of every snapshot.

    Returns:
        Shares that sum to 1; zeros for a scene without labelled tracks.

    Source: Bi et al., scenes as vectors in R^3; they do not state what is counted.
    """
    counts = np.zeros((len(labels), n_labels))
    for scene in range(len(labels)):
        labelled = labels[scene] >= 0
        label = labels[scene][labelled]
        if definition is SceneVector.unique_tracks:
            _, first = np.unique(track[scene][labelled], return_index=True)
            label = label[first]
        counts[scene] = np.bincount(label, minlength=n_labels)
    return counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)


def may_be_fitted(splits: Splits, fit_on: FitOn) -> Bool[np.ndarray, " scenes"]:
    """Mask of scenes that may be used in the fit of a clustering.

    By default the threshold scenes and those of no split. A scene that the splits dropped may share seconds of traffic
    with an evaluation or tuning scene, so it is not used.
    """
    if fit_on is FitOn.all:
        return np.ones(len(splits.label), dtype=bool)
    return np.isin(splits.label, (Split.REST, Split.THRESHOLD))


def cluster_scenes(
    vectors: Float[np.ndarray, "scenes shares"], allowed: Bool[np.ndarray, " scenes"], config: ClusterConfig
) -> SceneClusters:
    """Clusters of scenes by k-means, and their representatives.

    Args:
        vectors: Label shares of all scenes, see `label_shares`.
        allowed: Scenes the clustering may be fitted on.
        config: Number of clusters, restarts, seed.

    Raises:
        ValueError: No scene is left to fit on.

    Source: Bi et al., Eq. 6, k-means with 15 clusters.
    """
    # Slow to import, so imported only when a clustering is computed.
    from sklearn.cluster import KMeans

    has_vector = vectors.sum(axis=1) > 0
    fitted = allowed & has_vector
    if not fitted.any():
        message = (
            f"none of {len(vectors)} scenes can be clustered: {int(allowed.sum())} are outside the evaluation and "
            f"tuning splits, {int(has_vector.sum())} contain a track of tracks.min_frames"
        )
        remedy = "read more recordings, set split.evaluation and split.tuning to smaller numbers, or cluster.fit_on=all"
        raise InvalidInputError(Problem("scenes-too-few", message, remedy))
    if not has_vector.all():
        log.warning("%d scenes have no track of tracks.min_frames and no cluster", int((~has_vector).sum()))
    n_distinct = len(np.unique(np.round(vectors[fitted], _SHARE_DECIMALS), axis=0))
    n_clusters = min(config.n_clusters, n_distinct)
    if n_clusters < config.n_clusters:
        log.warning(
            "clusters of scenes: %d instead of cluster.n_clusters = %d, only %d different scenes among %d",
            n_clusters,
            config.n_clusters,
            n_distinct,
            int(fitted.sum()),
        )
    # Rounded, so that k-means treats equal scenes as equal.
    points = np.round(vectors, _SHARE_DECIMALS)
    # pyright infers the type from the default "auto".
    kmeans = KMeans(n_clusters, n_init=config.n_init, random_state=config.seed)  # pyright: ignore[reportArgumentType]
    kmeans.fit(points[fitted])
    order = np.lexsort(-kmeans.cluster_centers_.T[::-1])
    centres = kmeans.cluster_centers_[order]
    distance = ((points[:, None] - centres[None]) ** 2).sum(axis=2)
    labels = np.where(has_vector, distance.argmin(axis=1), -1)
    # Rounded, because distances of equal scenes must be equal for the lowest index to be chosen.
    to_centre = np.round(distance, 2 * _SHARE_DECIMALS)
    representatives = np.empty(n_clusters, dtype=np.int64)
    for cluster in range(n_clusters):
        members = np.flatnonzero(fitted & (labels == cluster))
        representatives[cluster] = members[to_centre[members, cluster].argmin()]
    return SceneClusters(vectors, fitted, labels, centres, representatives, n_distinct)


def references_of(scenes: SceneSet, clusters: SceneClusters, config: ClusterConfig) -> References:
    """Snapshots of the representatives, which simulated traffic is compared with.

    `slot_mean` takes the mean of each slot over the members of the cluster and their most frequent action, the lowest
    of equally frequent ones. Each reference represents the fitted scenes of its cluster.
    """
    members = [clusters.members(cluster) for cluster in range(len(clusters.centres))]
    sizes = np.array([len(of_cluster) for of_cluster in members])
    if config.representative is Representative.medoid:
        chosen = clusters.representatives
        speed, spacing = scenes.scaled_speed[chosen], scenes.spacing[chosen]
        mean_spacing, action = scenes.mean_spacing[chosen], scenes.action[chosen]
    else:
        speed, spacing, mean_spacing = (
            np.stack([values[of_cluster].mean(axis=0) for of_cluster in members])
            for values in (scenes.scaled_speed, scenes.spacing, scenes.mean_spacing)
        )
        votes = np.stack(
            [
                [(scenes.action[of_cluster] == number).sum(axis=0) for number in range(N_ACTIONS)]
                for of_cluster in members
            ]
        )
        action = votes.argmax(axis=1)
    return References(
        speed=jnp.asarray(speed, jnp.float32),
        spacing=jnp.asarray(spacing, jnp.float32),
        mean_spacing=jnp.asarray(mean_spacing, jnp.float32),
        action=jnp.asarray(action, jnp.int32),
        share=jnp.asarray(sizes / sizes.sum(), jnp.float32),
    )

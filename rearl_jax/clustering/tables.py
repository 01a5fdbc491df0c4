"""Clusterings as tables and as a flat summary."""

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.clustering.references import Clusters
from rearl_jax.config import ClusterTask
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.splits import Split, Splits
from rearl_jax.detection.references import References

_PERPLEXITY = 30.0
"""Perplexity of t-SNE. Source: van der Maaten & Hinton, JMLR 9 (2008) 2579: typical values are 5 to 50."""


def seeds(config: ClusterTask) -> str:
    """Seeds behind the tables."""
    text = f"kl.seed={config.kl.seed}, cluster.seed={config.cluster.seed}, split.seed={config.split.seed}"
    return text + (f", bo.seed={config.bo.seed}" if config.bo.enabled else "")


def track_table(clusters: Clusters) -> pd.DataFrame:
    """recording, track_id, label, distance to its centre [-]; one row per track."""
    tracks = clusters.tracks
    return pd.DataFrame(
        {
            "recording": pd.Categorical(tracks.recording),
            "track_id": tracks.track_id,
            "label": tracks.labels,
            "distance": tracks.distances,
        }
    )


def centre_table(clusters: Clusters) -> pd.DataFrame:
    """label, vertex, scaled_speed [m/s], position [m], distance [m]; one row per vertex of a centre."""
    centres = clusters.tracks.centres
    n_centres, _, n_vertices = centres.shape
    columns = {
        "label": np.repeat(np.arange(n_centres), n_vertices),
        "vertex": np.tile(np.arange(n_vertices), n_centres),
    }
    for feature, name in enumerate(("scaled_speed", "position", "distance")):
        columns[name] = centres[:, feature].reshape(-1)
    return pd.DataFrame(columns)


def scene_table(
    scenes: SceneSet, splits: Splits, clusters: Clusters, coordinates: Float[np.ndarray, "scenes 2"]
) -> pd.DataFrame:
    """One row per scene: split, share_<label>, cluster, whether it was fitted on or represents one, t-SNE x and y."""
    scene_clusters = clusters.scenes
    shares = {f"share_{label}": scene_clusters.vectors[:, label] for label in range(scene_clusters.vectors.shape[1])}
    return pd.DataFrame(
        {
            "scene_id": scenes.scene_id,
            "recording": scenes.recording,
            "start_time": scenes.start_time,
            "split": pd.Categorical([Split(label).name.lower() for label in splits.label]),
            **shares,
            "cluster": pd.arrays.IntegerArray(scene_clusters.labels.astype(np.int64), scene_clusters.labels < 0),
            "is_fitted": scene_clusters.fitted,
            "is_representative": np.isin(np.arange(len(scenes)), scene_clusters.representatives),
            "tsne_x": coordinates[:, 0],
            "tsne_y": coordinates[:, 1],
        }
    )


def reference_table(scenes: SceneSet, clusters: Clusters, references: References) -> pd.DataFrame:
    """One row per reference, second and slot; scene_id is that of the representative also for cluster means."""
    n_references, n_seconds, n_slots = references.speed.shape
    reference = np.repeat(np.arange(n_references), n_seconds * n_slots)
    return pd.DataFrame(
        {
            "reference": reference,
            "scene_id": scenes.scene_id[clusters.scenes.representatives][reference],
            "second": np.tile(np.repeat(np.arange(n_seconds), n_slots), n_references),
            "slot": np.tile(np.arange(n_slots), n_references * n_seconds),
            "scaled_speed": np.asarray(references.speed).reshape(-1),
            "spacing": np.asarray(references.spacing).reshape(-1),
            "mean_spacing": np.repeat(np.asarray(references.mean_spacing).reshape(-1), n_slots),
            "action": np.asarray(references.action).reshape(-1),
        }
    )


def embedding(vectors: Float[np.ndarray, "scenes shares"], seed: int) -> Float[np.ndarray, "scenes 2"]:
    """t-SNE coordinates of the scenes; zeros if fewer than four scenes differ, which needs no map.

    Source: van der Maaten & Hinton (2008); Bi et al. show their scenes in such a map.
    """
    from sklearn.manifold import TSNE

    if len(np.unique(vectors, axis=0)) < 4:
        return np.zeros((len(vectors), 2))
    perplexity = min(_PERPLEXITY, (len(vectors) - 1) / 3)
    coordinates = TSNE(2, perplexity=perplexity, init="random", random_state=seed, learning_rate="auto").fit_transform(
        vectors
    )
    return coordinates.astype(np.float64)


def summary(config: ClusterTask, scenes: SceneSet, splits: Splits, clusters: Clusters) -> dict:
    """Flat figures of both clusterings.

    Keys: n_tracks, n_short and n_alone (left out), n_fitted_tracks, k, l, iterations, cost (mean distance of fitted
    tracks to their centre, unitless), updates of the centres tried and, as long as the cost fell, kept, tracks (one
    object per label: number, share, mean scaled speed [m/s] and mean distance [m] of the centre), n_scenes,
    n_fitted_scenes, n_distinct (different vectors among these), n_scene_clusters of n_scene_clusters_wanted, fit_on,
    references (one object each: scene_id, recording, size and centre of its cluster), n_leaked (references that are
    evaluation or tuning scenes), search_rounds and search_best (objective).
    """
    tracks, scene_clusters = clusters.tracks, clusters.scenes
    k, n_vertices, iterations = (int(value) for value in tracks.parameters)
    counts = np.bincount(tracks.labels, minlength=k)
    held_out = np.concatenate([splits.evaluation, splits.tuning])
    trace = clusters.trace
    return {
        "n_tracks": len(tracks.labels),
        "n_short": int(tracks.counts[0]),
        "n_alone": int(tracks.counts[1]),
        "n_fitted_tracks": int(tracks.fitted),
        "k": k,
        "l": n_vertices,
        "iterations": iterations,
        "cost": float(tracks.costs.min()),
        "updates": len(tracks.costs) - 1,
        "updates_kept": int(tracks.costs.argmin()),
        "tracks": [
            {
                "label": label,
                "n_tracks": int(counts[label]),
                "share": float(counts[label] / counts.sum()),
                "scaled_speed": float(tracks.centres[label, 0].mean()),
                "distance": float(tracks.centres[label, 2].mean()),
            }
            for label in range(k)
        ],
        "n_scenes": len(scenes),
        "n_fitted_scenes": int(scene_clusters.fitted.sum()),
        "n_distinct": scene_clusters.n_distinct,
        "n_scene_clusters": len(scene_clusters.centres),
        "n_scene_clusters_wanted": config.cluster.n_clusters,
        "fit_on": config.cluster.fit_on.name,
        "references": [
            {
                "reference": cluster,
                "scene_id": int(scenes.scene_id[scene]),
                "recording": str(scenes.recording[scene]),
                "n_members": len(scene_clusters.members(cluster)),
                **{f"share_{label}": float(share) for label, share in enumerate(scene_clusters.centres[cluster])},
            }
            for cluster, scene in enumerate(scene_clusters.representatives)
        ],
        "n_leaked": int(np.isin(scene_clusters.representatives, held_out).sum()),
        "search_rounds": None if trace is None else len(trace),
        "search_best": None if trace is None else float(trace["objective"].to_numpy().max()),
    }

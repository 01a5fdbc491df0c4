"""Document of a clustering: clusters of tracks, representative scenes, and notes on them."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config import ClusterTask
from rearl_jax.config.clustering import Representative
from rearl_jax.document.document import DataSource, Document, Section
from rearl_jax.document.table import table_of

_TRACKS = {
    "label": "label",
    "n_tracks": "tracks",
    "share": "share",
    "scaled_speed": "scaled speed [m/s]",
    "distance": "distance [m]",
}

_CAPTIONS = {
    "tracks": "Some tracks coloured by cluster, and the centres: speed and distance over position.",
    "scenes": "All scenes on a t-SNE map of their label shares, coloured by cluster, the representatives marked.",
    "search": "Objective of every round with the best so far, and the best of every k and l.",
}


def document_of(
    config: ClusterTask, summary: Mapping[str, Any], sources: tuple[DataSource, ...], *, generated: bool
) -> Document:
    """The document of a clustering.

    Args:
        config: The task.
        summary: The figures of `summary.json`.
        sources: Data sets with their licences.
        generated: Whether any of the recordings were generated.
    """
    names = ", ".join(source.name for source in sources)
    columns = {"reference": "reference", "scene_id": "scene", "recording": "recording", "n_members": "members"}
    columns |= {f"share_{label}": f"share {label}" for label in range(summary["k"])}
    representatives = pd.DataFrame(summary["references"]).astype({"scene_id": str})
    tracks = table_of(f"Tracks of {names}", pd.DataFrame(summary["tracks"]), _TRACKS)
    scenes = table_of("Representative scenes", representatives, columns)
    return Document(
        title="Clusters of tracks and scenes",
        verdict=f"{summary['n_tracks']:,} tracks form {summary['k']} clusters, {summary['n_scenes']:,} scenes "
        f"form {summary['n_scene_clusters']}, each with a representative scene.",
        sections=(
            Section("Clusters of tracks, by label", tables=(tracks,)),
            Section(
                "Representative scenes, by cluster",
                tables=(scenes,),
                notes=tuple(_notes(config, summary)),
            ),
        ),
        command="cluster",
        generated=generated,
        sources=sources,
        captions=_CAPTIONS,
    )


def _notes(config: ClusterTask, figures: Mapping[str, Any]) -> list[str]:
    left_out = f"{figures['n_short']} shorter than {config.tracks.min_frames} frames, {figures['n_alone']} alone"
    notes = [
        f"{figures['n_tracks']} tracks ({left_out} left out), centres of {figures['l']} vertices fitted on "
        f"{figures['n_fitted_tracks']}; mean Frechet distance {figures['cost']:.4f}; "
        f"{figures['updates']} updates tried, {figures['updates_kept']} kept",
        f"{figures['n_scenes']} scenes, clusters fitted on {figures['n_fitted_scenes']} "
        f"(cluster.fit_on={figures['fit_on']})",
    ]
    if figures["n_scene_clusters"] < figures["n_scene_clusters_wanted"]:
        notes.append(
            f"clusters of scenes: {figures['n_scene_clusters']} instead of {figures['n_scene_clusters_wanted']}, as "
            f"only {figures['n_distinct']} different scenes are among these"
        )
    if config.cluster.representative is Representative.slot_mean:
        notes.append("references are means over their clusters; the scene named is the one nearest the centroid")
    if figures["n_leaked"]:
        notes.append(
            f"{figures['n_leaked']} references are evaluation or tuning scenes: results on these are not held out"
        )
    if figures["search_rounds"] is not None:
        notes.append(
            f"k, l and iterations ({figures['iterations']}) from a search of {figures['search_rounds']} rounds; best "
            f"objective {figures['search_best']:.4f}. The silhouette tends to prefer few clusters"
        )
    return notes

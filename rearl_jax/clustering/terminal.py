"""The tables in the terminal."""

from rich.markup import escape
from rich.table import Table

from rearl_jax.clustering.references import Clusters
from rearl_jax.clustering.tables import summary
from rearl_jax.config import ClusterTask
from rearl_jax.config.clustering import Representative
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.data.splits import Splits

_WIDTH = 100


def print_table(config: ClusterTask, scenes: SceneSet, splits: Splits, clusters: Clusters) -> None:
    """Prints the clusters of tracks, the representative scenes, and what a reader must know."""
    console = standard_output(_WIDTH)
    figures = summary(config, scenes, splits, clusters)
    sources = ", ".join(sorted({info.source for info in scenes.infos}))
    columns = ("label", "tracks", "share", "scaled speed [m/s]", "distance [m]")
    tracks = _table(f"Tracks of {sources}", *columns, generated=scenes.generated)
    for row in figures["tracks"]:
        speed, distance = f"{row['scaled_speed']:.1f}", f"{row['distance']:.0f}"
        tracks.add_row(str(row["label"]), str(row["n_tracks"]), f"{row['share']:.3f}", speed, distance)
    console.print(tracks)
    shares = [f"share {label}" for label in range(figures["k"])]
    columns = ("reference", "scene", "recording", "members", *shares)
    references = _table("Representative scenes", *columns, generated=scenes.generated)
    for row in figures["references"]:
        centre = [f"{row[f'share_{label}']:.3f}" for label in range(figures["k"])]
        references.add_row(
            str(row["reference"]), str(row["scene_id"]), row["recording"], str(row["n_members"]), *centre
        )
    console.print(references)
    print_notes(console, _notes(config, figures))


def _notes(config: ClusterTask, figures: dict) -> list[str]:
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


def _table(title: str, *columns: str, generated: bool) -> Table:
    table = titled_table(title, generated=generated)
    for column in columns:
        table.add_column(escape(column), justify="right", no_wrap=True)
    return table

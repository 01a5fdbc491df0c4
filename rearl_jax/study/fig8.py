"""The task `rearl study fig8`: clusters of scenes and their representatives, in the form of the paper's Fig. 8.

The clustering is made by `rearl cluster` in `cluster/`; the label of a track is its cluster. Writes `fig8.parquet`
(one row per cluster and figure), `fig8.png`, `fig8_clusters.png`, `page.html`, `config.json` and, last of all,
`summary.json`.
"""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.clustering import task
from rearl_jax.clustering.tables import seeds
from rearl_jax.config import ClusterTask, StudyFig8Task
from rearl_jax.data.recordings import data_id
from rearl_jax.data.scenes.cutting import PAPER_SCENES
from rearl_jax.document.document import Section
from rearl_jax.document.table import table_of
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.progress import progress_bar
from rearl_jax.results import read_summary
from rearl_jax.study import differences
from rearl_jax.study.document import Form, beside_paper, long_table, publish, remarks_on
from rearl_jax.study.parts import begin, carry_out, part_record
from rearl_jax.study.published import N_SCENE_CLUSTERS, N_TRACK_CLUSTERS

_CAPTIONS = {
    "fig8": (
        "All scenes on a t-SNE map of their label shares, coloured by cluster; stars are the representatives. "
        "Distances on such a map have little meaning, neighbourhoods do."
    ),
    "fig8_clusters": "Mean label shares of the scenes of each cluster, and its number of scenes.",
}

_COMPARED = {
    "n_scenes": ("scenes", PAPER_SCENES),
    "n_scene_clusters": ("clusters of scenes", N_SCENE_CLUSTERS),
    "k": ("clusters of tracks", N_TRACK_CLUSTERS),
    "n_tracks": ("tracks", None),
    "n_fitted_scenes": ("scenes fitted on", None),
    "n_distinct": ("different scenes among these", None),
}
"""Figures of the clustering, their headings, and the paper's."""


def _sections(config: StudyFig8Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    headings = {name: heading for name, (heading, _) in _COMPARED.items()}
    title, counts = "Fig. 8, ours and the paper's", table[table["row"] == "all"].assign(title="all recordings")
    columns = {"reference": "cluster", "scene_id": "representative", "recording": "recording"}
    columns |= {"n_members": "fitted scenes"}
    columns |= {f"share_{label}": f"share of label {label}" for label in range(summary["k"])}
    clusters = pd.DataFrame(summary["references"]).astype({"reference": str, "scene_id": str})
    tables = (
        beside_paper(title, counts, headings, dict.fromkeys(headings, 0)),
        table_of("Representative scenes, with the centres of their clusters", clusters, columns),
    )
    return (Section("Clusters", tables=tables),)


FORM = Form("fig8", "Clusters of scenes, compared with Fig. 8 of the paper", _sections, _CAPTIONS)


def run(config: StudyFig8Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.clustering.task.run`.
    """
    study = begin("study fig8", config, data_id(config.data))
    folder = carry_out(task.run, part_record(ClusterTask, config, f"{config.study}/cluster"))
    clustering = read_summary(folder)
    with progress_bar() as bar:
        scenes = read_inputs(config, study, bar, with_references=False).scenes
    differing = (
        *differences.of_data(config, scenes),
        *differences.of_references(len(clustering["references"]), config),
        f"clusters of tracks: (k,l)-clustering with l = {clustering['l']}; the paper does not state l",
    )
    summary: dict[str, Any] = {name: clustering[name] for name in _CLUSTERING_KEYS} | {
        "n_scenes_paper": PAPER_SCENES,
        "n_scene_clusters_paper": N_SCENE_CLUSTERS,
        "k_paper": N_TRACK_CLUSTERS,
        "references": clustering["references"],
    }
    use = f"{clustering['n_fitted_scenes']} of them fitted on"

    def draw() -> dict[str, bytes]:
        from rearl_jax.study.fig8_figure import draw_clusters

        scene_clusters = pd.read_parquet(folder / "scene_clusters.parquet")
        return {
            "fig8": (folder / "scenes.png").read_bytes(),
            "fig8_clusters": draw_clusters(scene_clusters, clustering["k"], generated=scenes.generated),
        }

    publish(
        study,
        FORM,
        config,
        scenes,
        _long(clustering),
        summary,
        remarks_on(config, scenes, use, _findings(clustering), differing),
        draw,
        seeds=seeds(config),
    )
    return summary


_CLUSTERING_KEYS = ("n_tracks", "k", "l", "n_scenes", "n_fitted_scenes", "n_distinct", "n_scene_clusters", "n_leaked")
"""Keys of the clustering's summary that are copied."""


def _findings(clustering: dict) -> list[str]:
    sentences = [
        f"{clustering['n_scenes']:,} scenes form {clustering['n_scene_clusters']} clusters, their tracks "
        f"{clustering['k']}; the paper has {PAPER_SCENES}, {N_SCENE_CLUSTERS} and {N_TRACK_CLUSTERS}."
    ]
    if clustering["n_scene_clusters"] < N_SCENE_CLUSTERS:
        sentences.append(
            f"There are fewer clusters of scenes because they are fitted on {clustering['n_fitted_scenes']} scenes, "
            f"{clustering['n_distinct']} of them different."
        )
    members = [row["n_members"] for row in clustering["references"]]
    sentences.append(
        f"The largest cluster holds {max(members)} of {sum(members)} fitted scenes, the smallest {min(members)}."
    )
    return sentences


def _long(clustering: dict) -> pd.DataFrame:
    """`row` (all or cluster_N), `metric`, `ours`, `paper`; for a cluster its scenes and label shares."""
    records: list[dict[str, Any]] = [
        {"row": "all", "metric": name, "ours": clustering[name], "paper": paper}
        for name, (_, paper) in _COMPARED.items()
    ]
    for row in clustering["references"]:
        names = ("scene_id", "n_members", *(f"share_{label}" for label in range(clustering["k"])))
        records += [
            {"row": f"cluster_{row['reference']}", "metric": name, "ours": row[name], "paper": None} for name in names
        ]
    return long_table(records)

"""The task `rearl study fig8`: clusters of scenes and their representatives, in the form of the paper's Fig. 8.

The clustering is made by `rearl cluster` in `cluster/`. Writes `fig8.parquet` (one row per cluster and figure),
`fig8.png`, `fig8_clusters.png`, `page.html`, `config.json` and, last of all, `summary.json`.
"""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from rearl_jax.clustering import task
from rearl_jax.clustering.tables import seeds
from rearl_jax.config import ClusterTask, StudyFig8Task
from rearl_jax.data.recordings import data_id, is_generated
from rearl_jax.data.scenes import PAPER_SCENES
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.layout import data_sources
from rearl_jax.evaluation.page import data_summary
from rearl_jax.evaluation.tables import source_names
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.study import differences
from rearl_jax.study.parts import carry_out, part_record
from rearl_jax.study.published import N_SCENE_CLUSTERS, N_TRACK_CLUSTERS
from rearl_jax.study.report import NONE, Cell, Line, Report, Shown, finish, long_table

CAPTIONS = {
    "fig8": (
        "All scenes on a t-SNE map of their label shares, coloured by cluster; stars are the representatives. "
        "Distances on such a map mean little, neighbourhoods do."
    ),
    "fig8_clusters": "What the clusters hold: mean label shares of their scenes, and how many scenes they have.",
}
"""What is below each figure."""


def run(config: StudyFig8Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.clustering.task.run`.
    """
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "study fig8", data_id(config.data), generated=generated)
    study.write_config()
    folder = carry_out(task.run, part_record(ClusterTask, config, f"{config.study}/cluster"))
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    with progress_bar() as bar:
        scenes = read_inputs(config, study, bar, with_references=False).scenes
    report = Report(
        title=f"Clusters of scenes beside Fig. 8 of the paper, on {source_names(scenes)}",
        tables=(_counts(found), _clusters(found)),
        findings=tuple(_findings(found)),
        differences=(
            *differences.of_data(config, scenes),
            *differences.of_references(len(found["references"]), config),
            f"clusters of tracks: (k,l)-clustering with l = {found['l']}; the paper does not state l",
        ),
        data={
            "summary": data_summary(config, scenes, f"{found['n_fitted_scenes']} of them fitted on"),
            "sources": data_sources(scenes.infos),
        },
        generated=generated,
        data_id=scenes.data_id,
        captions=CAPTIONS,
    )
    summary: dict[str, Any] = {name: found[name] for name in _KEPT} | {
        "n_scenes_paper": PAPER_SCENES,
        "n_scene_clusters_paper": N_SCENE_CLUSTERS,
        "k_paper": N_TRACK_CLUSTERS,
        "references": found["references"],
    }
    draw = partial(_draw, folder, found, generated=generated)
    finish(study, "study fig8", config, report, _long(found), summary, draw, seeds=seeds(config))
    return summary


_KEPT = ("n_tracks", "k", "l", "n_scenes", "n_fitted_scenes", "n_distinct", "n_scene_clusters", "n_leaked")


def _draw(folder: Path, found: dict, *, generated: bool) -> dict[str, bytes]:
    from rearl_jax.study.fig8_figure import draw_clusters

    scenes = pd.read_parquet(folder / "scene_clusters.parquet")
    return {
        "fig8": (folder / "scenes.png").read_bytes(),
        "fig8_clusters": draw_clusters(scenes, found["k"], generated=generated),
    }


def _compared(found: dict) -> tuple[tuple[str, str, int, int | None], ...]:
    """Title, name, ours and the paper's."""
    return (
        ("scenes", "n_scenes", found["n_scenes"], PAPER_SCENES),
        ("clusters of scenes", "n_scene_clusters", found["n_scene_clusters"], N_SCENE_CLUSTERS),
        ("clusters of tracks", "k", found["k"], N_TRACK_CLUSTERS),
        ("tracks", "n_tracks", found["n_tracks"], None),
        ("scenes fitted on", "n_fitted_scenes", found["n_fitted_scenes"], None),
        ("different scenes among these", "n_distinct", found["n_distinct"], None),
    )


def _counts(found: dict) -> Shown:
    lines = (
        Line(title, (Cell(f"{ours:,}"), Cell(NONE if paper is None else f"{paper:,}")))
        for title, _, ours, paper in _compared(found)
    )
    return Shown("Fig. 8, ours beside the paper's", ("ours", "paper"), tuple(lines))


def _clusters(found: dict) -> Shown:
    shares = [f"share_{label}" for label in range(found["k"])]
    lines = []
    for row in found["references"]:
        cells = (
            str(row["scene_id"]),
            row["recording"],
            str(row["n_members"]),
            *(f"{row[name]:.3f}" for name in shares),
        )
        lines.append(Line(f"cluster {row['reference']}", tuple(map(Cell, cells))))
    headings = (
        "representative",
        "recording",
        "fitted scenes",
        *(f"share of label {label}" for label in range(found["k"])),
    )
    return Shown("Representative scenes, with the centres of their clusters", headings, tuple(lines))


def _findings(found: dict) -> list[str]:
    said = []
    if found["n_scene_clusters"] < N_SCENE_CLUSTERS:
        said.append(
            f"Clusters of scenes: {found['n_scene_clusters']} instead of {N_SCENE_CLUSTERS}: they are fitted on "
            f"{found['n_fitted_scenes']} scenes, {found['n_distinct']} of them different."
        )
    members = [row["n_members"] for row in found["references"]]
    said.append(
        f"The largest cluster holds {max(members)} of {sum(members)} fitted scenes, the smallest {min(members)}."
    )
    return said


def _long(found: dict) -> pd.DataFrame:
    """`row` (all or cluster_N), `metric`, `ours`, `paper`; for a cluster its scenes and label shares."""
    records: list[dict[str, Any]] = [
        {"row": "all", "metric": name, "ours": ours, "paper": paper} for _, name, ours, paper in _compared(found)
    ]
    for row in found["references"]:
        names = ("scene_id", "n_members", *(f"share_{label}" for label in range(found["k"])))
        records += [
            {"row": f"cluster_{row['reference']}", "metric": name, "ours": row[name], "paper": None} for name in names
        ]
    return long_table(records)

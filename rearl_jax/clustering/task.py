"""The task `rearl cluster`: recordings in; clusters of tracks and scenes, and representative scenes out.

Writes into the study folder `tracks.parquet` (one row per track), `centres.parquet` (one per vertex),
`scene_clusters.parquet` (one per scene: label shares, cluster, t-SNE coordinates), `references.parquet` (one per
representative, second and slot), `bo_trace.parquet` with a search, PNG figures, `page.html`, `summary.json` and
`config.json`.
"""

import logging
import time

import numpy as np

from rearl_jax.clustering import tables
from rearl_jax.clustering.document import document_of
from rearl_jax.clustering.references import ReferenceBuilder
from rearl_jax.clustering.search import TRACE
from rearl_jax.config import ClusterTask
from rearl_jax.data.recordings import count_recordings, is_generated, iterate_recordings
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.splits import split_scenes
from rearl_jax.document.document import data_sources
from rearl_jax.document.publishing import publish_document
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study

log = logging.getLogger(__name__)

_STAGES = {"search": "search", "tracks": "clusters of tracks"}


def run(config: ClusterTask, *, show: bool = True) -> dict:
    """The summary, as written to summary.json; see `tables.summary`.

    Args:
        config: The task.
        show: Whether the table is printed.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, or too few tracks or scenes to
            cluster.
    """
    config.scenes.require_free()
    builder = ReferenceBuilder(config)
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "cluster", builder.data_id, generated=generated)
    trace = (f"{TRACE}.parquet",) if config.bo.enabled else ()
    if (stored := study.begin(resume=config.results.resume, reusable=trace)) is not None:
        return stored
    begin = time.perf_counter()
    with progress_bar() as bar:
        reading = bar.add_task("recordings", total=count_recordings(config.data))
        scenes = build_scenes(
            builder.passing(iterate_recordings(config.data)),
            config,
            progress=lambda name, n_scenes: bar.advance(reading),
        )
        splits = split_scenes(scenes, config.split)
        was_read, stages = time.perf_counter(), {}

        def watch(stage: str, done: int, total: int) -> None:
            if stage not in stages:
                stages[stage] = bar.add_task(_STAGES[stage], total=total)
            bar.update(stages[stage], completed=done, total=total)

        references, clusters = builder.build(scenes, splits, study, watch)
    # Logged, but not in the summary, so that a second run ends with the same files.
    log.info("read in %.1f s, clustered in %.1f s", was_read - begin, time.perf_counter() - was_read)
    metadata = {"scenes_id": scenes.data_id, "seeds": tables.seeds(config)}
    coordinates = tables.embedding(clusters.scenes.vectors, config.cluster.seed)
    study.write_table("tracks", tables.track_table(clusters), **metadata)
    study.write_table("centres", tables.centre_table(clusters), **metadata)
    study.write_table("scene_clusters", tables.scene_table(scenes, splits, clusters, coordinates), **metadata)
    study.write_table("references", tables.reference_table(scenes, clusters, references), **metadata)
    if clusters.trace is not None and not study.owns(TRACE):
        study.write_table(TRACE, clusters.trace, **metadata)  # the clustering, and with it its trace, was on disk
    summary = tables.summary(config, scenes, splits, clusters)
    document = document_of(config, summary, data_sources(scenes.infos), generated=generated)

    def draw_figures() -> dict[str, bytes]:
        from rearl_jax.clustering.figures import draw

        return draw(config, scenes, splits, clusters, coordinates)

    publish_document(study, document, config, summary, draw_figures, data_id=scenes.data_id, show=show)
    log.info("%d references written to %s", len(np.asarray(references.speed)), study.path)
    return summary

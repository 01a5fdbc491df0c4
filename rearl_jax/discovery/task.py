"""The task `rearl discover`: identifies effects missing from the traffic model in measured trajectories.

Writes into the study folder `base.parquet` (comparison of car-following models, by check driver), `null.parquet` (null
distribution: evidence if nothing is missing), `residuals.parquet`, `maps.parquet` and `planes.parquet` (residuals as
functions of one and of two variables), `drivers.parquet` (calibrated parameters), `candidates.parquet`,
`errors.parquet` (errors without and with the effects found, by report driver), `lane_changes.parquet` (predicted and
recorded lane changes, by report driver, if there are enough), `model.yaml`, figures, `page.html`, `verdict.json`,
`config.json` and, last of all, `summary.json`. With `discover.page=false`, residuals, maps, planes, figures and page
are not written.
"""

import json
from contextlib import nullcontext
from functools import partial

from rich.progress import Progress

from rearl_jax.config import DiscoverTask
from rearl_jax.data.recordings import data_id, is_generated
from rearl_jax.discovery.best_search import NULL_TABLE
from rearl_jax.discovery.comparison.comparison import BASE_TABLE
from rearl_jax.discovery.compute import compute, group_studies
from rearl_jax.discovery.discover import Discovery
from rearl_jax.discovery.report import tables
from rearl_jax.discovery.report.document import document_of
from rearl_jax.document.document import data_sources
from rearl_jax.document.html import page_of
from rearl_jax.document.terminal import print_document
from rearl_jax.models.file import write_model
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study


def run(config: DiscoverTask, *, show: bool = True, bar: Progress | None = None) -> dict:
    """The verdict, as in verdict.json.

    Args:
        config: The task.
        show: Whether to print the verdict.
        bar: Progress display; None for a new one.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, or too few drivers follow a
            leader.
    """
    identity, generated = data_id(config.data), is_generated(config.data)
    study = Study(config.results.root, config.study, config, "discover", identity, generated=generated)
    is_repeated = study.finished_summary() is not None  # a finished study is computed anew without reusing its groups
    if study.begin(resume=config.results.resume, needed=["verdict.json"]) is not None:
        return json.loads((study.path / "verdict.json").read_text(encoding="utf-8"))
    with progress_bar() if bar is None else nullcontext(bar) as lines:
        keep = None if is_repeated else partial(_write_group, study)
        discovery = compute(config, lines, identity, generated=generated, study=study, keep=keep)
    write(study, discovery)
    if show:
        print_document(document_of(config, discovery.verdict))
    return discovery.verdict


def write(study: Study, discovery: Discovery) -> None:
    """Writes tables, model, figures, page and verdict, first of groups, then of the study, and summary.json last."""
    config, generated = discovery.config, discovery.verdict["data"]["generated"]
    groups = discovery.groups
    folders = group_studies(study, config, list(groups), discovery.data_id, generated=generated)
    for name, group_study in folders.items():
        if groups[name].page_data is not None:  # else it is already written
            _write_group(study, group_study, groups[name])
    seeds = {"seeds": f"discover.seed={discovery.config.discover.seed}"}
    for name, table in discovery.tables.items():
        if name not in (NULL_TABLE, BASE_TABLE) or not study.owns(name):  # already written by the search
            study.write_table(name, table, **seeds)
    if discovery.model is not None:
        write_model(study.recorded_path("model.yaml"), discovery.model)
    if discovery.page_data is not None and discovery.config.discover.page:
        # Imported only here, because Matplotlib is slow to import.
        from rearl_jax.discovery.report.presentation import present

        present(study, discovery)
    elif groups and config.discover.page:
        document = document_of(config, discovery.verdict, sources=data_sources(discovery.infos))
        study.write_text("page.html", page_of(document, config, {}, data_id=discovery.data_id))
    study.write_text("verdict.json", json.dumps(discovery.verdict, indent=1, allow_nan=False) + "\n")
    study.write_summary(tables.summary(discovery.verdict))


def _write_group(study: Study, group_study: Study, discovery: Discovery) -> None:
    """Writes the discovery of a group into its folder `group_study` inside that of the study."""
    study.recorded_path(f"{group_study.path.relative_to(study.path).as_posix()}/")
    group_study.write_config()
    write(group_study, discovery)

"""The task `rearl discover blind`: runs discovery on data sets with hidden effects and scores the verdicts.

Writes into the study folder `protocol.json` and `truth.json` (before anything else), `verdicts/NAME.json` (one per data
set), then `cases.parquet` (one row per data set), `scores.parquet`, `sets.parquet`, `strengths.parquet`,
`parameters.parquet`, `calibration.parquet`, `confusion.parquet`, `strata.parquet` (broad priors only), `confusion.png`,
`strengths.png`, `page.html`, `config.json` and, last of all, `summary.json`. An interrupted study continues; a data set
with a verdict is never run again.
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from rich.progress import Progress

from rearl_jax.blind.details import confidence_calibration, parameter_rows
from rearl_jax.blind.document import document_of
from rearl_jax.blind.results import BlindResults
from rearl_jax.blind.rounds import Discover, count_finished, judge_cases, open_study, run_cases, time_left
from rearl_jax.blind.sealing import Protocol
from rearl_jax.blind.traffic.priors import PRIORS
from rearl_jax.config import DiscoverBlindTask, DiscoverTask, ResultsConfig
from rearl_jax.config.blind import StudyPriors
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.discovery import task as discovery
from rearl_jax.document.publishing import publish_document
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study, config_hash


def run(config: DiscoverBlindTask) -> dict:
    """Runs or resumes the study, writes its files, and gives back the content of summary.json: every rate with its
    interval.

    Raises:
        ModuleNotFoundError: The study contains data sets of SUMO, which is not installed.
        ValueError: `blind.sets` selects no data set, or the sealed truth was changed.
    """
    return run_with(config, discovery_of(config))


def run_with(config: DiscoverBlindTask, discover: Discover) -> dict:
    """The summary of a study with any implementation of discovery."""
    study = Study(config.results.root, config.study, config, "discover blind", generated=True)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    with progress_bar() as bar:
        protocol, results = _run_and_judge(config, study, discover, bar)
    seeds = {"seeds": f"blind.seed={protocol.master_seed}", "truth_sha256": str(protocol.truth_sha256)}
    tables = {
        "cases": results.case_table(),
        **results.tables(),
        "parameters": pd.DataFrame(parameter_rows(results.cases)),
        "calibration": pd.DataFrame(confidence_calibration(results.cases)),
    }
    for name, table in tables.items():
        study.write_table(name, table, **seeds)
    summary = {"master_seed": protocol.master_seed, "truth_sha256": protocol.truth_sha256, **results.summary()}
    if config.blind.priors is StudyPriors.broad:
        summary["priors"] = list(PRIORS.widened(config.blind.width).rows())
    document = document_of(summary, tables, vars(protocol))

    def draw() -> dict[str, bytes]:
        from rearl_jax.blind.figures import draw_figures  # matplotlib is slow to import

        return draw_figures(results)

    publish_document(study, document, config, summary, draw)
    return summary


def _run_and_judge(
    config: DiscoverBlindTask, study: Study, discover: Discover, bar: Progress
) -> tuple[Protocol, BlindResults]:
    """The protocol, and the results of the first `blind.first` data sets, each run unless it has a verdict."""
    # The truth of all data sets is sealed, so that stopping early reveals nothing about the remaining ones.
    whole = replace(config, blind=replace(config.blind, first=None))
    protocol, all_cases = open_study(study.path, config_hash(whole), config.blind, shown(bar, "truth"))
    cases = all_cases[: config.blind.first]
    text_on_remaining = time_left(count_finished(study.path, cases), time.perf_counter())
    line = bar.add_task("data sets", total=len(cases))

    def watch(done: int, total: int) -> None:
        bar.update(line, description=f"data sets{text_on_remaining(done, total)}", completed=done, total=total)

    run_cases(study.path, config.study, cases, discover, config.blind, watch)
    return protocol, BlindResults(judge_cases(study.path, protocol, cases), len(all_cases))


def discovery_of(config: DiscoverBlindTask) -> Discover:
    """The task `rearl discover` as a function of a folder."""

    def discover(folder: Path, study: str, oracle: str | None = None) -> dict[str, Any]:
        task = DiscoverTask(
            study=study,
            results=ResultsConfig(config.results.root),
            data=DataConfig(format=DataFormat.table, root=str(folder)),
            discover=replace(config.discover, oracle=oracle),
        )
        return discovery.run(task, show=False)

    return discover

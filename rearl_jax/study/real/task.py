"""The task `rearl study real`: discovery in real recordings, and comparison with known time gaps.

Each set of recordings has its own discovery in `sets/NAME/` and its time gaps in `facts/NAME/`. Writes `real.parquet`
(a row per set and group of drivers), `facts.parquet` (a row per car and setting), `differences.parquet` (between
settings), `page.html`, `config.json` and, last of all, `summary.json`.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from rich.progress import Progress

from rearl_jax.config import DataConfig, DiscoverTask, StudyRealTask
from rearl_jax.config.data import DataFormat
from rearl_jax.config.real import OWN, SETS, RealSet
from rearl_jax.data.recordings import data_id, is_generated, iterate_recordings, label_of_same
from rearl_jax.discovery import task as discovery
from rearl_jax.discovery.compute import read_drivers
from rearl_jax.discovery.observe.parts import AUTO
from rearl_jax.document.document import data_sources
from rearl_jax.document.html import page_of
from rearl_jax.document.terminal import print_document
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.study.parts import part_record
from rearl_jax.study.real.document import document_of, summary_of
from rearl_jax.study.real.facts import FACT_COLUMNS, differences_of, facts_of
from rearl_jax.study.real.known import KNOWN_TIME_GAPS, TOLERANCE
from rearl_jax.study.real.table import real_table, rows_of

TASK = "study real"

ALL_DRIVERS = 2**31
"""Largest number of drivers of a group whose time gaps are computed: no limit, because one car may have few tracks."""


@dataclass(frozen=True)
class Cell:
    """One discovery of the study.

    Attributes:
        name: Name of the set.
        title: Name of the set in tables.
        group: Name of the group of drivers if there is only one.
        part: Task of the discovery.
        id: Identity of the data.
        generated: Whether any of the data were generated.
    """

    name: str
    title: str
    group: str
    part: DiscoverTask
    id: str
    generated: bool

    @property
    def car(self) -> str | None:
        """Label of the car or person; None if unknown."""
        options = self.part.discover
        car = options.same or label_of_same(self.part.data)
        return None if options.by in (None, AUTO, car) else car


def cells_of(config: StudyRealTask) -> list[Cell]:
    """The discoveries of a study, in the order of `real.sets`.

    Raises:
        FileNotFoundError: There are no recordings.
    """
    return [_cell(config, name) for name in config.real.sets]


def _cell(config: StudyRealTask, name: str) -> Cell:
    if name == OWN:
        own, data, options = RealSet("own recordings", config.data.format), config.data, config.discover
    else:
        own = SETS[name]
        data = _shipped(config.data, own)
        options = replace(config.discover, by=own.by, same=None)
    part = part_record(DiscoverTask, config, f"{config.study}/sets/{name}", data=data, discover=options)
    return Cell(name, own.title, own.group, part, data_id(data), is_generated(data))


def _shipped(data: DataConfig, own: RealSet) -> DataConfig:
    """Data configuration of a set's shipped recordings."""
    recordings = own.recordings if data.recordings == "*" else data.recordings
    return replace(data, format=own.format, root=None, recordings=recordings, on_bad=own.on_bad)


def run(config: StudyRealTask) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: As `rearl_jax.discovery.task.run`, of each set.
    """
    cells = cells_of(config)
    identity = f"real-{hashlib.sha256(' '.join(cell.id for cell in cells).encode()).hexdigest()[:12]}"
    generated = any(cell.generated for cell in cells)
    study = Study(config.results.root, config.study, config, TASK, identity, generated=generated)
    study.write_config()
    rows, facts = [], []
    with progress_bar() as bar:
        line = bar.add_task("sets", total=len(cells))
        for number, cell in enumerate(cells):
            bar.update(line, description=f"set {number + 1} of {len(cells)}: {cell.title}", completed=number)
            verdict = discovery.run(cell.part, show=False, bar=bar)
            set_rows = rows_of(cell.name, cell.title, cell.group, verdict)
            rows += set_rows
            if cell.car is not None:
                facts.append(_facts(cell, cell.car, {row["group"]: row["base"] for row in set_rows}, bar))
            for finished in set(bar.task_ids) - {line}:
                bar.remove_task(finished)
    columns = ["set", "title", *FACT_COLUMNS]
    table = pd.concat(facts, ignore_index=True) if facts else pd.DataFrame(columns=columns)
    return _publish(study, config, cells, identity, real_table(rows), table)


def _facts(cell: Cell, car: str, bases: Mapping[str, str], bar: Progress) -> pd.DataFrame:
    """Time gaps of the cars of a set; read from disk if they were computed before.

    Args:
        cell: The set.
        car: Label of the car or person.
        bases: Car-following model that was chosen for each group.
        bar: Progress display.
    """
    by = cell.part.discover.by
    assert by is not None
    folder = cell.part.study.replace("/sets/", "/facts/")
    part = Study(cell.part.results.root, folder, cell.part, TASK, cell.id, generated=cell.generated)
    if not part.owns("facts"):
        models = {driver.model: driver for driver in cell.part.compared}
        all_drivers = replace(cell.part, discover=replace(cell.part.discover, max_drivers=ALL_DRIVERS))
        bar.add_task(f"time gaps of each {car}", total=None)
        table = facts_of(
            read_drivers(all_drivers, cell.id, bar, generated=cell.generated).data,
            by,
            car,
            {group: models[base] for group, base in bases.items()},
            KNOWN_TIME_GAPS if _is_zalazone(cell.part.data) else {},
            TOLERANCE,
            lane_changes=cell.part.discover.lane_changes,
        )
        part.write_table("facts", table)
    stored = pd.read_parquet(Path(part.path) / "facts.parquet")
    stored.insert(0, "title", cell.title)
    stored.insert(0, "set", cell.name)
    return stored


def _is_zalazone(data: DataConfig) -> bool:
    """True for the recordings with known time gaps."""
    return data.format is DataFormat.openacc and data.root is None


def _publish(
    study: Study, config: StudyRealTask, cells: list[Cell], identity: str, table: pd.DataFrame, facts: pd.DataFrame
) -> dict[str, Any]:
    """The summary, with tables, page and summary written."""
    differences = differences_of(facts, config.discover)
    read = (recording.info for cell in cells for recording in iterate_recordings(cell.part.data))
    infos = tuple({info.id: info for info in read}.values())
    data = f"{len(infos)} recordings in {len(cells)} sets: {', '.join(cell.title for cell in cells)}."
    remarks = Remarks(data, sources=data_sources(infos))
    seeds = {"seeds": f"discover.seed={config.discover.seed}"}
    study.write_table("real", table, **seeds, remarks=remarks.to_json())
    study.write_table("facts", facts)
    study.write_table("differences", differences, **seeds)
    generated = any(cell.generated for cell in cells)
    document = document_of(table, facts, differences, remarks, generated=generated)
    print_document(document)
    study.write_text("page.html", page_of(document, config, {}, data_id=identity))
    summary = summary_of(table, facts, differences)
    study.write_summary(summary)
    return summary

"""The task `rearl study real`: discovery in measured recordings, and comparison with known time gaps.

Each set of recordings has its own discovery in `sets/NAME/` and its time gaps in `facts/NAME/`. Writes `real.parquet`
(a row per set and group of drivers), `facts.parquet` (a row per car and setting), `differences.parquet` (between
settings), `page.html`, `config.json` and, last of all, `summary.json`.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

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
from rearl_jax.document.publishing import publish_document
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.study.parts import part_record
from rearl_jax.study.real.document import document_of, summary_of
from rearl_jax.study.real.facts import FACT_COLUMNS, differences_of, facts_of
from rearl_jax.study.real.known import KNOWN_TIME_GAPS
from rearl_jax.study.real.table import real_table, rows_of

TASK = "study real"

NO_DRIVER_LIMIT = 2**31
"""Value of discover.max_drivers without influence: one car may have few tracks, so time gaps use all."""


@dataclass(frozen=True)
class SetTask:
    """Discovery in one set of recordings.

    Attributes:
        name: Name of the set.
        title: Name of the set in tables.
        group: Name of the group of drivers if there is only one.
        part: Record of the discovery's task.
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


def set_tasks_of(config: StudyRealTask) -> list[SetTask]:
    """The discoveries of a study, in the order of `real.sets`.

    Raises:
        FileNotFoundError: There are no recordings.
    """
    return [_set_task(config, name) for name in config.real.sets]


def _set_task(config: StudyRealTask, name: str) -> SetTask:
    if name == OWN:
        real_set, data, options = RealSet("own recordings", config.data.format), config.data, config.discover
    else:
        real_set = SETS[name]
        data = _shipped(config.data, real_set)
        options = replace(config.discover, by=real_set.by, same=None)
    part = part_record(DiscoverTask, config, f"{config.study}/sets/{name}", data=data, discover=options)
    return SetTask(name, real_set.title, real_set.group, part, data_id(data), is_generated(data))


def _shipped(data: DataConfig, real_set: RealSet) -> DataConfig:
    """Data configuration of a set's shipped recordings."""
    recordings = real_set.recordings if data.recordings == "*" else data.recordings
    return replace(data, format=real_set.format, root=None, recordings=recordings, on_bad=real_set.on_bad)


def run(config: StudyRealTask) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: As in `rearl_jax.discovery.task.run`, of each set.
    """
    set_tasks = set_tasks_of(config)
    identity = f"real-{hashlib.sha256(' '.join(set_task.id for set_task in set_tasks).encode()).hexdigest()[:12]}"
    generated = any(set_task.generated for set_task in set_tasks)
    study = Study(config.results.root, config.study, config, TASK, identity, generated=generated)
    study.write_config()
    rows, facts = [], []
    with progress_bar() as bar:
        line = bar.add_task("sets", total=len(set_tasks))
        for number, set_task in enumerate(set_tasks):
            bar.update(line, description=f"set {number + 1} of {len(set_tasks)}: {set_task.title}", completed=number)
            verdict = discovery.run(set_task.part, show=False, bar=bar)
            set_rows = rows_of(set_task.name, set_task.title, set_task.group, verdict)
            rows += set_rows
            if set_task.car is not None:
                facts.append(_facts(set_task, set_task.car, {row["group"]: row["base"] for row in set_rows}, bar))
            for finished in set(bar.task_ids) - {line}:
                bar.remove_task(finished)
    fact_table = pd.concat(facts, ignore_index=True) if facts else pd.DataFrame(columns=["set", "title", *FACT_COLUMNS])
    table, differences = real_table(rows), differences_of(fact_table, config.discover)
    remarks, seeds = _remarks(set_tasks), {"seeds": f"discover.seed={config.discover.seed}"}
    study.write_table("real", table, **seeds, remarks=remarks.to_json())
    study.write_table("facts", fact_table)
    study.write_table("differences", differences, **seeds)
    document = document_of(table, fact_table, differences, remarks, generated=generated)
    summary = summary_of(table, fact_table, differences)
    publish_document(study, document, config, summary, data_id=identity)
    return summary


def _remarks(set_tasks: list[SetTask]) -> Remarks:
    """The recordings and their sources."""
    read = (recording.info for set_task in set_tasks for recording in iterate_recordings(set_task.part.data))
    infos = tuple({info.id: info for info in read}.values())
    data = f"{len(infos)} recordings in {len(set_tasks)} sets: {', '.join(set_task.title for set_task in set_tasks)}."
    return Remarks(data, sources=data_sources(infos))


def _facts(set_task: SetTask, car: str, bases: Mapping[str, str], bar: Progress) -> pd.DataFrame:
    """Time gaps of the cars of a set, with the model chosen for each group; read from disk if computed before."""
    by = set_task.part.discover.by
    assert by is not None
    folder = set_task.part.study.replace("/sets/", "/facts/")
    part = Study(set_task.part.results.root, folder, set_task.part, TASK, set_task.id, generated=set_task.generated)
    if not part.owns("facts"):
        models = {driver.model: driver for driver in set_task.part.compared}
        all_drivers = replace(set_task.part, discover=replace(set_task.part.discover, max_drivers=NO_DRIVER_LIMIT))
        bar.add_task(f"time gaps of each {car}", total=None)
        table = facts_of(
            read_drivers(all_drivers, set_task.id, bar, generated=set_task.generated).data,
            by,
            car,
            {group: models[base] for group, base in bases.items()},
            KNOWN_TIME_GAPS if _is_zalazone(set_task.part.data) else {},
            lane_changes=set_task.part.discover.lane_changes,
        )
        part.write_table("facts", table)
    stored = pd.read_parquet(part.path / "facts.parquet")
    stored.insert(0, "title", set_task.title)
    stored.insert(0, "set", set_task.name)
    return stored


def _is_zalazone(data: DataConfig) -> bool:
    """True for the recordings with known time gaps."""
    return data.format is DataFormat.openacc and data.root is None

"""A complete discovery of missing effects: reads recordings, groups drivers if requested, analyses each group."""

import json
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from rich.progress import Progress

from rearl_jax.config import DiscoverTask
from rearl_jax.data.recordings import label_of_same
from rearl_jax.data.records import Recording
from rearl_jax.discovery.discover import Discovery, discovery_of
from rearl_jax.discovery.groups.kinds import Kinds, driver_likelihoods, kinds_of, purity
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.parts import AUTO, Parts, labelled_recordings, measured_drivers
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.gate import Finding
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.split import n_shared, split_drivers
from rearl_jax.discovery.report.groups import verdict_of_groups
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import shown
from rearl_jax.results import Study

Keep = Callable[[Study, Discovery], None]
"""Function that writes a discovery into its folder."""

UNKNOWN = "unknown"
"""Name of the group of drivers whose group is unknown."""


@dataclass(frozen=True)
class Drivers:
    """All drivers of the recordings, with the identity of the data and the artefacts and properties of the measurement
    that the columns show; `generated` is true if any of the data were generated, not measured.
    """

    id: str
    generated: bool
    recordings: list[Recording]
    findings: list[Finding]
    data: Measured

    def parts(self, data: Measured, seed: int) -> Parts:
        """The given drivers in three parts: for fits, for the check of candidates, and for the report of errors."""
        fitted, checked, reported = split_drivers(data, seed=seed)
        notes = _each_once([note for recording in self.recordings for note in recording.info.notes])
        if data.jumps:
            notes += (f"positions jump {data.jumps} times in the recordings; samples around the jumps are excluded",)
        if shared := n_shared(fitted, reported):
            text = "too few persons or cars to separate them: runs are divided, and"
            notes += (f"{text} {shared} of them are among both fitted and report drivers",)
        infos = tuple(recording.info for recording in self.recordings)
        return Parts(self.id, self.generated, infos, self.findings, fitted, checked, reported, notes)


def compute(
    config: DiscoverTask,
    bar: Progress,
    identity: str,
    *,
    generated: bool,
    study: Study | None = None,
    keep: Keep | None = None,
) -> Discovery:
    """Effects that the traffic model lacks; nothing is printed.

    Args:
        config: The task.
        bar: Progress display.
        identity: Identity of the data.
        generated: Whether any of the data were generated, not measured.
        study: Folder that keeps the simulated null distributions (the longest computation), so that an interrupted run
            continues; None to keep nothing.
        keep: Writes a finished group, so that an interrupted run does not compute it again; None to keep none.

    Raises:
        FileNotFoundError, ValueError: As in `task.run`.
    """
    begin = time.perf_counter()
    drivers = read_drivers(config, identity, bar, generated=generated)
    by = config.discover.by
    if by is None:
        parts = drivers.parts(drivers.data, config.discover.seed)
        discovery = discovery_of(config, parts, drivers.recordings, bar, study)
    else:
        kinds = _kinds(config, drivers, bar) if by == AUTO else None
        names = drivers.data.label(by).tolist() if kinds is None else kinds.names()
        discovery = _of_groups(config, drivers, names, bar, study, keep)
        if kinds is not None:
            labels = {name: drivers.data.label(name).tolist() for name in drivers.data.labels}
            purities = {name: purity(kinds.of_driver, values, config.discover.seed) for name, values in labels.items()}
            known = {name: value for name, value in purities.items() if value is not None}
            discovery.verdict["grouping"] |= kinds.plain() | {"purity": known}
    discovery.verdict["seconds"] = time.perf_counter() - begin
    return discovery


def _kinds(config: DiscoverTask, drivers: Drivers, bar: Progress) -> Kinds:
    """Kinds of drivers, clustered by their calibrated parameters."""
    progress = shown(bar, "distinguishing kinds of drivers")
    progress(0, 2)
    solver = solver_of(drivers.data, prior_of(config.driver))
    fit = base_of(solver, drivers.data, lane_changes=config.discover.lane_changes).fit
    progress(1, 2)
    kinds = kinds_of(driver_likelihoods(solver, fit), config.discover.seed)
    progress(2, 2)
    return kinds


def read_drivers(config: DiscoverTask, identity: str, bar: Progress, *, generated: bool) -> Drivers:
    """Drivers of the recordings, with findings on the measurement.

    Raises:
        ValueError: The frame rates differ, a label is unknown, or too few drivers follow a leader long enough.
    """
    progress = shown(bar, "reading recordings")
    recordings: list[Recording] = []
    for recording in labelled_recordings(config.data, config.discover):
        recordings.append(recording)
        progress(len(recordings), len(recordings))
    identity_label = label_of_same(config.data)
    findings, data = measured_drivers(recordings, config.discover, prior_of(config.driver), identity_label)
    if data.n_drivers < THRESHOLDS.least_drivers:
        message = (
            f"{data.n_drivers} drivers follow a leader long enough, at least {THRESHOLDS.least_drivers} are needed"
        )
        remedy = "choose more recordings, or longer ones"
        raise InvalidInputError(Problem("too-few-drivers", message, remedy, key="data.recordings"))
    return Drivers(identity, generated, recordings, findings, data)


def group_studies(
    study: Study, config: DiscoverTask, names: Sequence[str], identity: str, *, generated: bool
) -> dict[str, Study]:
    """The folder of each group inside that of the study, by name of the group."""
    folders = [re.sub(r"[^A-Za-z0-9_.-]", "_", name).lstrip(".") or "_" for name in names]
    if len(set(folders)) < len(folders):
        folders = [f"{folder}_{number}" for number, folder in enumerate(folders)]
    root = study.path / "groups"
    return {
        name: Study(root, folder, config, "discover", identity, generated=generated)
        for name, folder in zip(names, folders, strict=True)
    }


def _of_groups(
    config: DiscoverTask,
    drivers: Drivers,
    group_of_driver: Sequence[str | None],
    bar: Progress,
    study: Study | None,
    keep: Keep | None,
) -> Discovery:
    """A discovery of each group, with a joint verdict; the group of a driver is None if it is unknown."""
    data_of_groups, left_out = grouped(drivers.data, group_of_driver)
    if not data_of_groups:
        sizes = ", ".join(f"{name} {n}" for name, n in left_out.items())
        message = f"no group has the {THRESHOLDS.least_drivers} drivers that are needed: {sizes}"
        raise InvalidInputError(Problem("too-few-drivers", message, "choose another label", key="discover.by"))
    names = list(data_of_groups)
    studies = {} if study is None else group_studies(study, config, names, drivers.id, generated=drivers.generated)
    groups, parts = {}, {name: drivers.parts(data, config.discover.seed) for name, data in data_of_groups.items()}
    for name in names:
        group_study = studies.get(name)
        finished = None if group_study is None or keep is None else _finished(config, drivers.id, group_study)
        if finished is None:
            group_config, label = replace(config, study=f"{config.study}_{name}"), f"{config.discover.by} {name}"
            finished = discovery_of(group_config, parts[name], drivers.recordings, bar, group_study, label)
            if group_study is not None and keep is not None:
                keep(group_study, finished)
                finished = replace(finished, model=None, page_data=None)  # written, so the memory is freed
        groups[name] = finished
    verdict = verdict_of_groups(config.discover, groups, parts, left_out)
    infos = tuple(recording.info for recording in drivers.recordings)
    return Discovery(config, drivers.id, verdict, groups=groups, infos=infos)


def grouped(data: Measured, names: Sequence[str | None]) -> tuple[dict[str, Measured], dict[str, int]]:
    """Drivers of each group by its name, and the number of drivers by name for groups that are left out: those with too
    few drivers to fit, check and report on different ones, and drivers whose group is unknown. `names` are those of
    each driver's group, None where it is unknown.
    """
    group_of = np.array([UNKNOWN if name is None else name for name in names], object)
    groups, left_out = {}, {}
    for name in sorted(set(group_of.tolist())):
        is_member = group_of == name
        if name == UNKNOWN or is_member.sum() < THRESHOLDS.least_drivers:
            left_out[name] = int(is_member.sum())
        else:
            groups[name] = data.of_drivers(is_member)
    return groups, left_out


def _finished(config: DiscoverTask, identity: str, study: Study) -> Discovery | None:
    """Verdict and errors of a group that an interrupted run has written; None if it has not."""
    if study.finished_summary(["verdict.json", "errors.parquet"]) is None:
        return None
    verdict = json.loads((study.path / "verdict.json").read_text(encoding="utf-8"))
    return Discovery(config, identity, verdict, {"errors": pd.read_parquet(study.path / "errors.parquet")})


def _each_once(notes: Sequence[str]) -> tuple[str, ...]:
    """Notes without repetition; of notes that differ only in numbers, the first is kept."""
    by_form: dict[str, list[str]] = {}
    for note in notes:
        by_form.setdefault(re.sub(r"\d+", "#", note), []).append(note)
    kept = []
    for alike in by_form.values():
        n_others = len(set(alike)) - 1
        kept.append(f"{alike[0]} (and {n_others} alike with other numbers)" if n_others else alike[0])
    return tuple(kept)

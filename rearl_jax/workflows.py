"""The main tasks as functions that take tables, arrays or files and return tables and records.

Measured trajectories are a table in memory in the canonical schema (see the page on recordings), or the files that
`data={"format": "highd", "root": "/data/highD"}` names. All other keys are those of the command line, groups as
mappings: `evaluate(method="rearl", eval={"n_runs": 1})` is `rearl evaluate method=rearl eval.n_runs=1`. Nothing is
printed, and results are written only by their `save`. `start()` of `rearl_jax.runtime`, called first, uses all cores
and keeps compiled programs, as the command does.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import pandas as pd
import yaml

from rearl_jax.config import DiscoverTask, EvaluateTask, PrepareTask, ResultsConfig
from rearl_jax.config._schema import finished, from_plain, keys_of, nearest
from rearl_jax.config.data import DataConfig
from rearl_jax.config.driver import DriverConfig
from rearl_jax.data.recordings import data_id, is_generated, iterate_recordings
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.tables.in_memory import in_memory
from rearl_jax.discovery.calibration import Calibration, calibration
from rearl_jax.discovery.discover import Discovery
from rearl_jax.evaluation.estimates import Estimate
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.models.record import RepairedModel
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import silent
from rearl_jax.results import Study
from rearl_jax.runtime import check_platform, double_precision
from rearl_jax.tasks import TASKS

Record = TypeVar("Record")

Measured: TypeAlias = pd.DataFrame | SceneSet | None
"""Measured trajectories: a table in the canonical schema, or scenes that were cut before; None for files."""


@dataclass(frozen=True)
class Evaluated:
    """Simulated scenes compared with measured ones.

    Attributes:
        config: The task.
        evaluation: Everything that was measured.
        estimates: The figures of the table, by row and metric.
        has_own_scenes: Whether the scenes were given, and not cut from the recordings of `config.data`.
    """

    config: EvaluateTask
    evaluation: Evaluation
    estimates: dict[tuple[str, str], Estimate]
    has_own_scenes: bool = False

    @property
    def summary(self) -> pd.DataFrame:
        """One row per method (or reference row) and metric: `value`, interval, unit, definition."""
        from rearl_jax.evaluation.tables import summary_table

        return summary_table(self.evaluation, self.estimates, self.evaluation.config.eval.confidence)

    @property
    def runs(self) -> pd.DataFrame:
        """One row per scored rollout and recorded scene, a column per metric."""
        from rearl_jax.evaluation.tables import run_table

        return run_table(self.evaluation)

    def save(self, folder: str | Path) -> None:
        """Writes all that `rearl evaluate` writes."""
        from rearl_jax.evaluation import task
        from rearl_jax.evaluation.traffic import inputs_id

        config, scenes = _in_folder(self.config, folder), self.evaluation.scenes
        identity = inputs_id(config, scenes.data_id if self.has_own_scenes else None)
        study = Study(config.results.root, config.study, config, "evaluate", identity, generated=scenes.generated)
        study.write_config()
        evaluation = replace(self.evaluation, config=_in_folder(self.evaluation.config, folder))
        task.write_tables(study, evaluation, self.estimates)
        task.write_pages(study, evaluation, self.estimates)

    def __str__(self) -> str:
        from rearl_jax.document.terminal import text_of
        from rearl_jax.evaluation.task import documented

        return text_of(documented(self.evaluation, self.estimates))


@dataclass(frozen=True)
class Discovered:
    """Effects that the traffic model lacks.

    Attributes:
        discovery: Everything that was found.
    """

    discovery: Discovery

    @property
    def verdict(self) -> dict[str, Any]:
        """The content of verdict.json, see `discovery.verdict`."""
        return self.discovery.verdict

    @property
    def candidates(self) -> pd.DataFrame:
        """One row per candidate; empty if `discover.oracle` names the missing effects."""
        return self.discovery.tables.get("candidates", pd.DataFrame())

    @property
    def model(self) -> RepairedModel | None:
        """The repaired model; None if `discover.oracle` names the missing effects."""
        return self.discovery.model

    def save(self, folder: str | Path) -> None:
        """Writes all that `rearl discover` writes, `model.yaml` among it."""
        from rearl_jax.discovery import task

        config = _in_folder(self.discovery.config, folder)
        identity, generated = self.discovery.data_id, self.verdict["data"]["generated"]
        study = Study(config.results.root, config.study, config, "discover", identity, generated=generated)
        study.write_config()
        with double_precision():
            task.write(study, replace(self.discovery, config=config))

    def __str__(self) -> str:
        from rearl_jax.discovery.report.document import document_of
        from rearl_jax.document.terminal import text_of

        return text_of(document_of(self.discovery.config, self.verdict))


def read_recordings(**keys: Any) -> Iterator[Recording]:
    """Recordings, each read when it is needed; the shipped ones by default. Example:

        for recording in read_recordings(format="highd", root="/data/highD"):
            print(recording.info.id, recording.table["speed"].mean())

    Args:
        **keys: Those of the group `data`, see `rearl prepare --help`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, or one is bad.
    """
    return iterate_recordings(_configured(DataConfig, keys))


def cut_scenes(measured: pd.DataFrame | None = None, **keys: Any) -> SceneSet:
    """All scenes of recordings. Example:

        scenes = cut_scenes(data={"format": "highd", "root": "/data/highD"}, scenes={"seconds": 30})
        print(scenes.speed.shape)  # scenes, seconds, vehicles

    Args:
        measured: A table in the canonical schema; None for the recordings that `data` names.
        **keys: Those of `rearl prepare`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or no scene can be cut.
    """
    config = _with_table(_configured(PrepareTask, keys), measured)
    return build_scenes(iterate_recordings(config.data), config)


def evaluate(measured: Measured = None, **keys: Any) -> Evaluated:
    """The metric table: simulated against measured scenes. Example:

        result = evaluate(method="rearl", eval={"n_runs": 1})
        print(result)
        table = result.summary.pivot(index="metric", columns="method", values="value")
        result.save("results/mine")

    Args:
        measured: A table in the canonical schema, or scenes; None for the recordings that `data` names.
        **keys: Those of `rearl evaluate`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or scenes are too few.
    """
    from rearl_jax.evaluation import task
    from rearl_jax.evaluation.estimates import estimates

    config = _task_record("evaluate", keys)
    task.check(config)
    scenes = None
    if isinstance(measured, SceneSet):
        scenes = measured
    else:
        config = _with_table(config, measured)
    with silent() as bar:
        evaluation = task.compute(config, bar, scenes=scenes)
    estimated = estimates(evaluation.rows, evaluation.held_out, config.eval)
    return Evaluated(config, evaluation, estimated, has_own_scenes=scenes is not None)


def discover(measured: pd.DataFrame | None = None, **keys: Any) -> Discovered:
    """Effects that the traffic model lacks according to measured trajectories; takes minutes. Example:

        found = discover(data={"format": "highd", "root": "/data/highD"})
        print(found.verdict["verdict"], [effect["name"] for effect in found.verdict["effects"]])
        found.save("results/highd")
        print(evaluate(model="results/highd/model.yaml"))

    Args:
        measured: A table in the canonical schema; None for the recordings that `data` names.
        **keys: Those of `rearl discover`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or too few drivers follow.
    """
    from rearl_jax.discovery.compute import compute

    config = _with_table(_task_record("discover", keys), measured)
    with double_precision(), silent() as bar:
        return Discovered(compute(config, bar, data_id(config.data), generated=is_generated(config.data)))


def calibrate(measured: pd.DataFrame | None = None, **keys: Any) -> Calibration:
    """Drivers calibrated to measured trajectories, by published IDM unless `driver` names another model. Example:

        found = calibrate(data={"format": "table", "root": "trajectories.csv"})
        print(found.drivers[["desired_speed", "time_gap", "jam_gap"]].describe())
        found.save("model.yaml")
        print(evaluate(model="model.yaml", variant="calibrated"))

    Args:
        measured: A table in the canonical schema; None for the recordings that `data` names.
        **keys: Those of `rearl discover`; keys of the search for effects have no effect here.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or no driver follows
            another.
    """
    config = _with_table(_configured(DiscoverTask, keys), measured)
    with double_precision():
        return calibration(config)


def _task_record(words: str, keys: Mapping[str, Any]) -> Any:
    """The configuration of a task; keys of a group imply others as on the command line.

    Raises:
        ValueError: As in `_configured`, or a key names the folder the command would write to.
    """
    for name in ("study", "results"):
        if name in keys:
            message = f"must be left out, for {words}() writes nothing: call save(FOLDER) of its result"
            raise InvalidInputError(Problem("key-implied", message, key=name))
    task = next(task for task in TASKS if task.words == words)
    implied = dict(word.split("=") for group, word in task.implied.items() if group in keys)  # the last one counts
    for name, value in implied.items():
        keys = _with_default(keys, name, value)
    return _configured(task.load_config(), keys)


def _with_default(keys: Mapping[str, Any], name: str, value: str) -> Mapping[str, Any]:
    """The keys, completed by one key whose value is a text as on the command line, unless it is among them."""
    group, _, key = name.rpartition(".")
    default = {key: yaml.safe_load(value)}
    return default | dict(keys) if not group else {**keys, group: default | dict(keys.get(group, {}))}


def _with_table(config: Record, table: pd.DataFrame | None) -> Record:
    """The configuration with a table in memory as its recordings.

    Raises:
        BadRecordingError: A column is missing.
    """
    if table is None:
        return config
    changed: Any = replace(config, data=in_memory(table, config.data))  # type: ignore[attr-defined, type-var]
    return changed


def _in_folder(config: Any, folder: str | Path) -> Any:
    """The configuration of a study that is stored in a folder."""
    path = Path(folder)
    return replace(config, study=path.name, results=ResultsConfig(str(path.parent)))


def _configured(kind: type[Record], keys: Mapping[str, Any]) -> Record:
    """The record with these keys, checked as those of the command line are.

    Raises:
        ValueError: A key is unknown, its value is none of its choices, or it is out of its range, or the environment
            variables name a platform that this JAX does not have.
    """
    defaults: Any = kind()
    if "driver" in keys and hasattr(defaults, "driver"):
        defaults = replace(defaults, driver=DriverConfig.record_for(keys["driver"])())
    known = keys_of(defaults)
    for name in _names(keys, known):
        if name not in known:
            raise InvalidInputError(Problem("key-unknown", f"is not a key; nearest: {nearest(name, known)}", key=name))
    check_platform()
    return finished(from_plain(kind, keys))


def _names(keys: Mapping[str, Any], known: Collection[str], prefix: str = "") -> Iterator[str]:
    """Full names of the keys in nested mappings; a mapping may be a known key's value, a text the choice of a group."""
    for name, value in keys.items():
        if isinstance(value, Mapping) and prefix + name not in known:
            yield from _names(value, known, f"{prefix}{name}.")
        elif not (prefix + name == "driver" and isinstance(value, str)):
            yield prefix + name

"""The main tasks as functions: data in, tables and records out.

Keys are those of the command line, groups as mappings: `evaluate(method="rearl", eval={"n_runs": 1})` is
`rearl evaluate method=rearl eval.n_runs=1`, and `data={"format": "highd", "root": "/data/highD"}` names recordings.
Nothing is printed, and nothing is kept unless a folder is named. `start()` of `rearl_jax.runtime`, called first, uses
all cores and keeps compiled programs, as the command does.
"""

import contextlib
import io
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import jax
import pandas as pd

from rearl_jax.config import DiscoverTask, PrepareTask
from rearl_jax.config._schema import finished, from_plain, keys_of, nearest
from rearl_jax.config.data import DataConfig
from rearl_jax.config.driver import DriverConfig
from rearl_jax.data.recordings import Recording, iterate_recordings
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.data.scenes import build_scenes
from rearl_jax.discovery.calibration import Calibration, calibration
from rearl_jax.models.file import read_model
from rearl_jax.models.record import RepairedModel
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.tasks import TASKS

Record = TypeVar("Record")


@dataclass(frozen=True)
class Evaluated:
    """Simulated against measured scenes.

    Attributes:
        summary: One row per method (or reference row) and metric: `value`, interval, unit, definition.
        runs: One row per scored rollout and recorded scene, a column per metric.
        text: The table as the command prints it.
    """

    summary: pd.DataFrame
    runs: pd.DataFrame
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Discovered:
    """What the traffic model lacks.

    Attributes:
        verdict: As in verdict.json, see `discovery.verdict`.
        candidates: One row per candidate; empty where `discover.oracle` says what is missing.
        model: The repaired model; None for the same reason.
        text: The verdict as the command prints it.
    """

    verdict: dict[str, Any]
    candidates: pd.DataFrame
    model: RepairedModel | None
    text: str

    def __str__(self) -> str:
        return self.text


def read_recordings(**keys: Any) -> Iterator[Recording]:
    """Recordings, each read when it is asked for; the shipped ones by default. Example:

        for recording in read_recordings(format="highd", root="/data/highD"):
            print(recording.info.id, recording.table["speed"].mean())

    Args:
        **keys: Those of the group `data`, see `rearl prepare --help`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, or one is bad.
    """
    return iterate_recordings(_configured(DataConfig, keys))


def cut_scenes(**keys: Any) -> SceneSet:
    """All scenes of recordings. Example:

        scenes = cut_scenes(data={"format": "highd", "root": "/data/highD"}, scenes={"seconds": 30})
        print(scenes.speed.shape)  # scenes, seconds, vehicles

    Args:
        **keys: Those of `rearl prepare`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or no scene can be cut.
    """
    config = _configured(PrepareTask, keys)
    groups = (config.scenes, config.speed, config.tracks, config.features, config.spacing)
    return build_scenes(iterate_recordings(config.data), *groups)


def evaluate(folder: str | Path | None = None, **keys: Any) -> Evaluated:
    """The metric table: simulated against measured scenes. Example:

        result = evaluate(method="rearl", eval={"n_runs": 1})
        print(result)
        table = result.summary.pivot(index="metric", columns="method", values="value")

    Args:
        folder: Where to keep everything the command writes; None to keep nothing.
        **keys: Those of `rearl evaluate`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or scenes are too few.
    """
    with _run("evaluate", folder, keys) as (_, place, text):
        summary, runs = (pd.read_parquet(place / f"{name}.parquet") for name in ("summary", "runs"))
        return Evaluated(summary, runs, text)


def discover(folder: str | Path | None = None, **keys: Any) -> Discovered:
    """What the traffic model lacks in measured trajectories; takes minutes. Example:

        found = discover("results/highd", data={"format": "highd", "root": "/data/highD"})
        print(found.verdict["verdict"], [effect["name"] for effect in found.verdict["effects"]])
        print(evaluate(model="results/highd/model.yaml", speed={"norm": "none"}))

    Args:
        folder: Where to keep everything the command writes, `model.yaml` among it; None to keep nothing.
        **keys: Those of `rearl discover`.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or too few drivers follow.
    """
    with _run("discover", folder, keys) as (verdict, place, text):
        told = not (place / "model.yaml").exists()
        candidates = pd.DataFrame() if told else pd.read_parquet(place / "candidates.parquet")
        return Discovered(verdict, candidates, None if told else read_model(place / "model.yaml"), text)


def calibrate(**keys: Any) -> Calibration:
    """Drivers calibrated to measured trajectories, by published IDM unless `driver` names another model. Example:

        found = calibrate(data={"format": "table", "root": "trajectories.csv"})
        print(found.drivers[["desired_speed", "time_gap", "jam_gap"]].describe())
        found.save("model.yaml")
        print(evaluate(model="model.yaml", variant="calibrated", speed={"norm": "none"}))

    Args:
        **keys: Those of `rearl discover`; what concerns the search for effects means nothing here.

    Raises:
        FileNotFoundError, ValueError: A key is unknown, there are no recordings, one is bad, or nobody follows.
    """
    config = _configured(DiscoverTask, keys)
    with _double_precision():
        return calibration(config)


@contextlib.contextmanager
def _run(words: str, folder: str | Path | None, keys: Mapping[str, Any]) -> Iterator[tuple[dict, Path, str]]:
    """What a task returns, the folder of its files while they are read, and what it prints."""
    for name in ("study", "results"):
        if name in keys:
            said = f"must be left out: name the folder instead, {words}(folder=...)"
            raise InvalidInputError(Problem("key-implied", said, key=name))
    task = next(task for task in TASKS if task.words == words)
    implied = (word.split("=") for group, word in task.implied.items() if group in keys)
    with TemporaryDirectory() as temporary, contextlib.redirect_stdout(io.StringIO()) as printed:
        place = Path(temporary, words) if folder is None else Path(folder)
        own = {"study": place.name, "results": {"root": str(place.parent)}}
        config = _configured(task.load_config(), dict(implied) | dict(keys) | own)
        with _double_precision() if task.x64 else contextlib.nullcontext():
            result = task.load_run()(config)
        yield result, place, printed.getvalue()


def _configured(kind: type[Record], keys: Mapping[str, Any]) -> Record:
    """The record with these keys, checked as those of the command line are.

    Raises:
        ValueError: A key is unknown, its value is none of its choices, or it is out of its range.
    """
    defaults: Any = kind()
    if "driver" in keys and hasattr(defaults, "driver"):
        said = keys["driver"]
        defaults = replace(
            defaults, driver=DriverConfig.record_for({"model": said} if isinstance(said, str) else said)()
        )
    known = keys_of(defaults)
    for name in _names(keys, known):
        if name not in known:
            raise InvalidInputError(Problem("key-unknown", f"is no key; nearest: {nearest(name, known)}", key=name))
    return finished(from_plain(kind, keys))


def _names(keys: Mapping[str, Any], known: Collection[str], prefix: str = "") -> Iterator[str]:
    """Full names of the keys in nested mappings; a mapping may be a known key's value, a text the choice of a group."""
    for name, value in keys.items():
        if isinstance(value, Mapping) and prefix + name not in known:
            yield from _names(value, known, f"{prefix}{name}.")
        elif not (prefix + name == "driver" and isinstance(value, str)):
            yield prefix + name


@contextlib.contextmanager
def _double_precision() -> Iterator[None]:
    """JAX's x64 mode for as long as it is needed, in all threads."""
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)

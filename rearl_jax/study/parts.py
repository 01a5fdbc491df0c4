"""Parts of a study: other tasks, run in sub-folders of the study.

A finished part with the same configuration, data and code is not run again, so an interrupted study continues.
"""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from rearl_jax.config import ResultsConfig
from rearl_jax.data.recordings import is_generated
from rearl_jax.results import Study

Record = TypeVar("Record")


def begin(task: str, config: Any, data_id: str) -> Study:
    """The folder of a study of recordings, such as `study table1`, with its configuration in it."""
    study = Study(config.results.root, config.study, config, task, data_id, generated=is_generated(config.data))
    study.write_config()
    return study


def part_record(kind: type[Record], config: Any, study: str, **other: Any) -> Record:
    """The record of a part in the folder `study` below results.root; keys that both tasks have take the values of the
    study, except for the groups or keys in `other`.
    """
    names = {item.name for item in fields(kind)} & {item.name for item in fields(config)}  # type: ignore[arg-type]
    shared = {name: getattr(config, name) for name in names - {"study", "results"}}
    results = ResultsConfig(config.results.root, resume=True)
    return kind(**(shared | {"study": study, "results": results} | other))


def carry_out(run: Callable[..., dict], part: Any) -> Path:
    """The folder of a part, after its task has been run in it; only the study's own table is printed."""
    run(part, show=False)
    return Path(part.results.root) / part.study

"""Sweep files: a multirun stored as `sweeps/NAME.yaml`, and the overrides it is translated into. An example:

# What triggers a decision
task: evaluate
keys:
  method: rearl
  detection.cues: both,speed,spacing
"""

from pathlib import Path
from typing import Any

import yaml

from rearl_jax import tasks
from rearl_jax.cli.composition import UsageError, file_problem
from rearl_jax.config._schema import as_written, nearest
from rearl_jax.problems import Problem
from rearl_jax.tasks import Task


def sweep_files(config_dir: str | None = None) -> dict[str, Path]:
    """Sweep files by name: the shipped ones, and those in the folder `sweeps` of the user's configuration folder."""
    folders = [tasks.sweeps_dir()] if config_dir is None else [tasks.sweeps_dir(), Path(config_dir) / "sweeps"]
    return {file.stem: file for folder in folders for file in sorted(folder.glob("*.yaml"))}


def read_sweep(name: str, task: Task, config_dir: str | None) -> list[str]:
    """Overrides of a sweep file; the study is named after it.

    Raises:
        UsageError: There is no such file, it belongs to another task, or it is not a mapping of `task` and `keys`.
    """
    files = sweep_files(config_dir)
    if name not in files:
        message = f"must be one of {', '.join(sorted(files))}; nearest: {nearest(name, files)}"
        raise UsageError(Problem("choice-unknown", message, key="--sweep", value=name))
    content = _content(files[name])
    if content["task"] != task.words:
        message = f"belongs to another task: rearl {content['task']} --sweep {name}"
        raise UsageError(Problem("sweep-of-another-task", message, key=f"--sweep {name}"))
    return [f"study={name}", *(f"{key}={as_written(value)}" for key, value in content["keys"].items())]


def sweeps_of(task: Task) -> dict[str, Path]:
    """The shipped sweep files of a task."""
    return {name: file for name, file in sweep_files().items() if _content(file)["task"] == task.words}


def _content(file: Path) -> dict[str, Any]:
    if problem := file_problem(file):
        raise UsageError(Problem("file-unreadable", problem, file=str(file)))
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    if not (isinstance(content, dict) and set(content) == {"task", "keys"} and isinstance(content["keys"], dict)):
        message = "must hold `task: NAME` and `keys:` with one `key: values` per line, nothing else"
        raise UsageError(Problem("sweep-malformed", message, file=str(file)))
    return content

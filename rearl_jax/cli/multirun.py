"""Hydra multirun: one job for every combination of the swept values, each in a folder of its own.

Finished jobs are not run again, so a killed multirun continues where it stopped. At the end the task combines the
results of all jobs. A cell holds the swept keys and their values in one job.
"""

import itertools
import logging
import os
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rearl_jax import tasks
from rearl_jax.cli.composition import (
    UsageError,
    checked_overrides,
    choices,
    compose_task,
    hydra_errors,
    register,
    with_mappings_opened,
)
from rearl_jax.cli.launchers import launcher_errors, settings
from rearl_jax.cli.running import JobError, complain, is_for_user, run_task
from rearl_jax.cli.streams import make_writable
from rearl_jax.cli.values import with_original_keys
from rearl_jax.code_version import code_hash
from rearl_jax.config._schema import finished
from rearl_jax.problems import Problem
from rearl_jax.results import cell_folder, config_hash, first_part, path_inside, read_summary
from rearl_jax.tasks import Task
from rearl_jax.whole_files import claim

log = logging.getLogger(__name__)

_NOT_IN_FOLDER_NAME = ("study", "results.root", "results.resume")
"""Keys whose values are not part of the folder name of a job."""


def run_many(task: Task, overrides: list[str], config_dir: str | None) -> tuple[Path, list[dict[str, str]]]:
    """Runs all jobs, then combines the finished ones; returns their folder, and the values of the swept keys in each.

    Raises:
        JobError: A job failed; the others have run.
        FolderInUseError: Another multirun writes to the folder.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    overrides = checked_overrides(task, overrides, config_dir, many=True)
    parsed = OverridesParser.create().parse_overrides(overrides)
    with hydra_errors(task, overrides):
        swept = swept_values(parsed, choices(task, config_dir))
    _require_own_folders(swept)
    fixed = [text for text, item in zip(overrides, parsed, strict=True) if item.key_or_group not in swept]
    task_overrides = [text for text in fixed if not text.lstrip("+~").startswith("hydra")]
    common = compose_task(task, task_overrides, config_dir)
    folder = path_inside(Path(common.results.root), common.study, "study")
    # Without swept keys the folder is that of the only job, which may run in another process and locks it itself.
    lock = claim(folder) if swept else None
    failed = None
    cells = cells_of(swept)
    given = {item.key_or_group: item.value() for item in parsed if item.key_or_group not in swept}
    try:
        _launch(task, with_mappings_opened(task, overrides), given, len(cells), config_dir)
    except JobError as error:
        failed = error
    if failed is not None:
        # If a job failed before it wrote anything, its folder may still contain the results of an earlier multirun.
        cells = [cell for cell in cells if not _is_outdated(task, task_overrides, folder, cell, config_dir)]
    if task.collect is not None and swept:
        task.load_collect()(common, cells)
        print(f"all cells: {folder}")
    del lock
    if failed is not None:
        raise failed
    return folder, cells


def _is_outdated(
    task: Task, fixed: Sequence[str], folder: Path, cell: Mapping[str, str], config_dir: str | None
) -> bool:
    """True if the results in the folder of a job belong to another configuration, or were computed by other code."""
    job_folder = cell_folder(folder, cell)
    try:
        first = first_part(read_summary(job_folder))
    except FileNotFoundError:
        return False
    overrides = [*fixed, *(f"{key}={value}" for key, value in cell.items())]
    if first["config_hash"] != config_hash(compose_task(task, overrides, config_dir)):
        log.warning("%s: these results belong to another configuration and are left out", job_folder)
        return True
    if first["code_hash"] != code_hash():
        log.warning("%s: these results were computed by other code and are left out", job_folder)
        return True
    return False


def swept_values(overrides: Sequence[Any], groups: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """Values of every swept key, as written.

    Args:
        overrides: The words of the command line as Hydra reads them; if a key is given twice, the last value counts.
        groups: Choices of every config group, which `glob(...)` chooses from.

    Raises:
        HydraException: A sweep has no list of values, such as `interval(0,1)`.
    """
    swept = {item.key_or_group for item in overrides if item.is_sweep_override()}
    return {item.key_or_group: _values(item, groups) for item in overrides if item.key_or_group in swept}


def _require_own_folders(swept: Mapping[str, Sequence[str]]) -> None:
    """Raise UsageError if two jobs would write to the same folder, or to folders that do not lie in a common one."""
    for key, values in swept.items():
        if key in _NOT_IN_FOLDER_NAME:
            message = "is common to all jobs and cannot have several values"
            remedy = "give it one value; the folder of every job is named after the values of the other keys"
            raise UsageError(Problem("key-not-swept", message, remedy, key=key, value=",".join(values)))
        if repeated := [value for value in values if values.count(value) > 1]:
            raise UsageError(
                Problem("value-repeated", "has a value twice", "leave one out", key=key, value=repeated[0])
            )


def _values(override: Any, groups: Mapping[str, Iterable[str]]) -> list[str]:
    """Values of one override, as written; a single one if it is not a sweep."""
    from hydra.core.override_parser.types import Glob

    if not override.is_sweep_override():
        return [override.get_value_element_as_str()]
    value = override.value()
    if isinstance(value, Glob):
        return value.filter(sorted(groups.get(override.key_or_group, ())))
    return list(override.sweep_string_iterator())


def cells_of(swept: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """The values of the swept keys in every job, in the order of the jobs: the last key changes fastest."""
    return [dict(zip(swept, values, strict=True)) for values in itertools.product(*swept.values())]


def _launch(task: Task, overrides: list[str], given: Mapping[str, Any], n_jobs: int, config_dir: str | None) -> None:
    """Hands the jobs to Hydra's sweeper and launcher."""
    import hydra
    from hydra.core.utils import env_override

    unnamed = sorted({*_NOT_IN_FOLDER_NAME, *given})
    defaults = [
        "hydra.output_subdir=null",
        f"hydra.job.name={task.config_name}",
        f"hydra.job.config.override_dirname.exclude_keys=[{','.join(unnamed)}]",
        "hydra.job.config.override_dirname.item_sep='/'",
        "hydra.sweep.dir=${results.root}/${study}",
        "hydra.sweep.subdir=${hydra.job.override_dirname}",
    ]
    of_launcher = settings(given, n_jobs)
    folder = [] if config_dir is None else [f"--config-dir={Path(config_dir).resolve()}"]
    register(task)
    # Without the first variable Hydra prints errors and exits by itself; without the second Ray sends usage statistics.
    environment = {"HYDRA_FULL_ERROR": "1", "RAY_USAGE_STATS_ENABLED": os.environ.get("RAY_USAGE_STATS_ENABLED", "0")}
    original_argv, sys.argv = sys.argv, ["rearl", "--multirun", *folder, *defaults, *of_launcher, *overrides]
    try:
        with env_override(environment), hydra_errors(task, overrides), launcher_errors(given):
            hydra.main(config_path=str(tasks.conf_dir()), config_name=task.config_name, version_base="1.3")(run_job)()
    finally:
        sys.argv = original_argv


def run_job(composed: Any) -> None:
    """Runs one job of a multirun; a launcher may call it in another process.

    Raises:
        JobError: The job failed because of its keys, data or files.
        RuntimeError: It failed otherwise, in another process; the message contains the traceback.
    """
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    make_writable()
    hydra = HydraConfig.get()
    task = next(task for task in tasks.TASKS if task.config_name == hydra.job.config_name)
    name = hydra.job.override_dirname
    try:
        config: Any = OmegaConf.to_object(composed)
        config = finished(with_original_keys(config))
        config.study = "/".join(part for part in (config.study, name) if part)
        if not any(text.startswith("results.resume=") for text in hydra.overrides.task):
            config.results.resume = True
        run_task(task, config)
    except Exception as error:
        is_here = hydra.runtime.choices["hydra/launcher"] == "basic"
        if not is_for_user(error):
            if is_here:
                raise
            # An error returned from another process loses its traceback, and not every error can be returned.
            raise RuntimeError(f"in the job {name}: {traceback.format_exc()}") from None
        if is_here:
            complain(f"{name}: {error}")
        else:
            log.error("%s: %s", name, error)
        raise JobError(f"at least one job failed, the first at {name}: {error}") from error

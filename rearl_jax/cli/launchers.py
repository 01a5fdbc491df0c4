"""Launchers that run the jobs of a multirun in parallel: checks of the plugin, and the cores of each job.

The additional settings that Hydra needs are derived from the command line. Without a launcher the jobs run one after
another in this process, and no setting is needed.
"""

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from rearl_jax.cli.composition import UsageError
from rearl_jax.cli.running import JobError, complain
from rearl_jax.machine import available_cores
from rearl_jax.problems import Problem

_EXTRAS = {
    "joblib": ("joblib", "hydra-joblib-launcher"),
    "ray": ("ray", "hydra-ray-launcher"),
    "submitit_local": ("submitit", "hydra-submitit-launcher"),
    "submitit_slurm": ("submitit", "hydra-submitit-launcher"),
}
"""For each launcher: the pip extra of this package that installs it, and the Hydra plugin in that extra."""

_RAY = {
    "init.include_dashboard": "false",
    # The mixed output of parallel jobs is unreadable; each job has its log in its folder.
    "init.log_to_driver": "false",
    "init.logging_level": "warning",
    "remote.num_gpus": "0",
    # A job that was killed for its memory once would be killed again.
    "remote.max_retries": "0",
}
"""Default settings of Ray, under `hydra.launcher.ray`; the user may override them."""

_LIMITS = ("JAX_NUM_CPU_DEVICES", "OMP_NUM_THREADS")
"""Environment variables that limit the cores of a job: of JAX, and of the libraries below NumPy and scikit-learn."""

_UNKNOWN = -1
"""Number of cores of a job if only Slurm knows it."""


def settings(given: Mapping[str, Any], n_jobs: int) -> list[str]:
    """Overrides for Hydra that give every job its share of the cores; the user's overrides take precedence.

    Args:
        given: Keys and values of the command line that are the same in all jobs.
        n_jobs: Jobs of the multirun.

    Raises:
        UsageError: The launcher is not installed, or cannot be used like this.
    """
    launcher = given.get("hydra/launcher")
    if launcher not in _EXTRAS:
        return []
    _check(launcher, given)
    keys: dict[str, Any] = {}
    if launcher == "joblib":
        keys, cores = _joblib(given, n_jobs)
    elif launcher == "ray":
        keys, cores = _ray(given, n_jobs)
    else:
        # Locally, submitit starts all jobs at once; Slurm confines each to what it was given.
        share = available_cores() // n_jobs if launcher == "submitit_local" else _UNKNOWN
        cores = _number(given, "hydra.launcher.cpus_per_task", share)
    if cores != _UNKNOWN:
        keys |= {f"hydra.job.env_set.{name}": max(cores, 1) for name in _LIMITS if name not in os.environ}
    return [f"++{key}={value}" for key, value in keys.items()]


@contextmanager
def launcher_errors(given: Mapping[str, Any]) -> Iterator[None]:
    """Raise JobError instead of a launcher's own exceptions about a job that was killed or refused."""
    try:
        yield
    except KeyboardInterrupt:
        if given.get("hydra/launcher") == "submitit_slurm":
            complain("jobs that Slurm has accepted keep running; `squeue --me` lists them, `scancel` ends them")
        raise
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in ("joblib", "ray", "submitit"):
            raise
        raise JobError(f"a job was not completed: {error}") from error


def _joblib(given: Mapping[str, Any], n_jobs: int) -> tuple[dict[str, Any], int]:
    """Keys for joblib, and the cores of a job; as in joblib, -1 jobs at a time means one per core, -2 one less.

    Batches have one job, because in joblib's larger batches jobs would wait for each other while cores are idle.
    """
    wanted = _number(given, "hydra.launcher.n_jobs", -1)
    at_once = min(wanted if wanted > 0 else max(available_cores() + 1 + wanted, 1), n_jobs)
    return {"hydra.launcher.n_jobs": at_once, "hydra.launcher.batch_size": 1}, available_cores() // at_once


def _ray(given: Mapping[str, Any], n_jobs: int) -> tuple[dict[str, Any], int]:
    """Keys for Ray, and the cores of a job: an equal share of this machine, or one core on a running cluster.

    The address is set, because without one Ray would use any cluster of this user that it finds. The number of cores is
    set, because a job that requests more cores than Ray has detected would wait forever; a running cluster refuses it.
    """
    keys: dict[str, Any] = {"init.address": _address(given), **_RAY}
    if _is_elsewhere(given):
        share = 1
        keys |= {"init.num_cpus": "null", "init.object_store_memory": "null"}
    else:
        size = _number(given, "hydra.launcher.ray.init.num_cpus", available_cores())
        share = max(size // n_jobs, 1)
        keys |= {"init.num_cpus": size}
    cores = _number(given, "hydra.launcher.ray.remote.num_cpus", share)
    keys |= {"remote.num_cpus": cores}
    return {f"hydra.launcher.ray.{key}": value for key, value in keys.items()}, cores


def _check(launcher: str, given: Mapping[str, Any]) -> None:
    """Raise UsageError if the launcher is not installed, or Slurm or a shared folder is missing."""
    extra, plugin = _EXTRAS[launcher]
    try:
        distribution(plugin)
    except PackageNotFoundError as error:
        remedy = f"pip install 'rearl_jax[{extra}]'"
        problem = Problem("extra-missing", f"needs the extra {extra}", remedy, key="hydra/launcher", value=launcher)
        raise UsageError(problem) from error
    if launcher == "submitit_slurm" and shutil.which("srun") is None:
        fault, remedy = "needs Slurm, which this machine does not have", "call rearl on a machine with `srun`"
        raise UsageError(Problem("slurm-missing", fault, remedy, key="hydra/launcher", value=launcher))
    if _is_elsewhere(given) and not Path(str(given.get("results.root", ""))).is_absolute():
        fault = "must be a folder that all machines of the cluster see, results.root=/FOLDER, and data.root likewise"
        raise UsageError(Problem("folder-not-shared", fault, key="results.root"))


def _number(given: Mapping[str, Any], key: str, default: int) -> int:
    value = given.get(key)
    if value is not None and not isinstance(value, (int, float)):
        raise UsageError(Problem("wrong-type", "must be a number", key=key, value=value))
    return default if value is None else int(value)


def _address(given: Mapping[str, Any]) -> str:
    """Address of the running Ray cluster; `local` for a cluster on this machine that exists while the jobs run."""
    return str(given.get("hydra.launcher.ray.init.address") or os.environ.get("RAY_ADDRESS") or "local")


def _is_elsewhere(given: Mapping[str, Any]) -> bool:
    """True if the jobs run on a Ray cluster that this process has not started."""
    return given.get("hydra/launcher") == "ray" and _address(given) != "local"

"""Worker processes in which highway-env runs, with NumPy's arithmetic chosen by an environment variable.

On processors with AVX-512 NumPy has its own vector versions of arcsin, tan, arctan and pow. They differ from those of
the C library, which XLA calls, by one unit in the last place for 0.5 to 10 % of the arguments, and highway-env's
lateral controller, unstable below about 0.1 m/s, amplifies that. Therefore the reference runs in processes in which
NumPy's documented variable NPY_DISABLE_CPU_FEATURES disables NumPy's vector versions. Other processors have no vector
versions. The control of the report compares highway-env with and without the vector versions.
"""

import multiprocessing
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from importlib import import_module

from rearl_jax.validation.records import Recorded
from rearl_jax.validation.scenarios import Scenario

DISABLING_VARIABLE = "NPY_DISABLE_CPU_FEATURES"
"""Environment variable that disables NumPy's vector versions, read when NumPy is imported."""


class Variant(Enum):
    """Variant of a run of highway-env.

    plain: with the functions of the C library; the reference. vectorised: with NumPy's default functions; the control.
    nudged: plain, but every vehicle starts one unit in the last place further ahead; shows how highway-env amplifies
        the smallest possible difference.
    """

    plain = "plain"
    vectorised = "vectorised"
    nudged = "nudged"


@dataclass(frozen=True)
class Job:
    """One scene to run with one variant."""

    scenario: Scenario
    variant: Variant


def vector_features() -> tuple[str, ...]:
    """Names of NumPy's dispatched instruction sets at the level of AVX-512 that this machine has; none elsewhere."""
    # Imported by name: NumPy's annotations leave this module out.
    umath = import_module("numpy._core._multiarray_umath")
    dispatched, present = umath.__cpu_dispatch__, umath.__cpu_features__
    return tuple(name for name in dispatched if ("AVX512" in name or name == "X86_V4") and present.get(name))


def run(jobs: Iterable[Job], n_workers: int) -> Iterator[tuple[Job, Recorded]]:
    """The jobs with their results, in order of completion. All jobs must use the same arithmetic.

    Raises:
        RuntimeError: If highway-env failed in a scene; names it.
    """
    jobs = list(jobs)
    if not jobs:
        return
    vectorised = {job.variant is Variant.vectorised for job in jobs}
    if len(vectorised) > 1:
        raise ValueError("jobs with and without NumPy's vector functions cannot share worker processes")
    with _environment(vectorised=vectorised.pop()):
        # Not forked: a worker must load NumPy itself, and JAX has threads.
        context = multiprocessing.get_context("spawn")
        executor = ProcessPoolExecutor(min(n_workers, len(jobs)), mp_context=context)
        try:
            waiting = {executor.submit(_simulate, job): job for job in jobs}
            for future in as_completed(waiting):
                job = waiting.pop(future)
                try:
                    yield job, future.result()
                except Exception as error:
                    scene = f"scene {job.scenario.index} of {job.scenario.set_name}"
                    raise RuntimeError(f"highway-env failed in {scene} ({job.variant.value}): {error}") from error
        finally:
            executor.shutdown(cancel_futures=True)


@contextmanager
def _environment(*, vectorised: bool) -> Iterator[None]:
    """Environment variables for new processes with or without NumPy's vector functions; restored at the end."""
    value_before = os.environ.get(DISABLING_VARIABLE)
    if vectorised:
        os.environ.pop(DISABLING_VARIABLE, None)
    elif features := vector_features():
        os.environ[DISABLING_VARIABLE] = " ".join([*(value_before or "").replace(",", " ").split(), *features])
    try:
        yield
    finally:
        if value_before is None:
            os.environ.pop(DISABLING_VARIABLE, None)
        else:
            os.environ[DISABLING_VARIABLE] = value_before


def _simulate(job: Job) -> Recorded:
    """The recorded scene of a job; runs in a worker, the only kind of process that imports highway-env."""
    from rearl_jax.validation import reference

    return reference.simulate(job.scenario, nudged=job.variant is Variant.nudged)

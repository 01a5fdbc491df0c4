"""Reference trajectories kept in the study folder, so that a killed or repeated run continues where it stopped.

One file per scene, named after everything its content depends on. Files are written whole or not at all.
"""

import hashlib
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from pathlib import PurePosixPath

from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study
from rearl_jax.validation import records, workers
from rearl_jax.validation.records import Recorded
from rearl_jax.validation.workers import Job

REFERENCES = "reference/"
"""Folder of the files in a study."""

FORMAT_VERSION = 1
"""Version of the stored scenes. Raise it when scenes are recorded differently, so that older files are not read."""


class ReferenceStore:
    """Scenes highway-env has run, as files under `reference/` of a study."""

    def __init__(self, study: Study) -> None:
        """Uses the folder of the study."""
        self._study = study
        self._origin = f"{FORMAT_VERSION} highway-env {version('highway-env')} numpy {version('numpy')}"

    def collect(self, jobs: Iterable[Job], n_workers: int) -> Iterator[Job]:
        """The jobs as their files become available: stored ones at once, then the others as they are finished."""
        missing = []
        for job in jobs:
            if (self._study.path / self._name(job)).exists():
                yield job
            else:
                missing.append(job)
        for job, recorded in workers.run(missing, n_workers):
            self._study.write_bytes(self._name(job), records.to_bytes(recorded))
            yield job

    def load(self, job: Job) -> Recorded:
        """A collected scene.

        Raises:
            InvalidInputError: The file cannot be read.
        """
        path = self._study.path / self._name(job)
        content = path.read_bytes()
        try:
            return records.from_bytes(content)
        except Exception as error:  # zipfile and NumPy raise many kinds for a damaged file
            problem = Problem("reference-damaged", f"is damaged ({error})", "delete it and run again", file=str(path))
            raise InvalidInputError(problem) from error

    def _name(self, job: Job) -> str:
        key = hashlib.sha256(f"{self._origin} {job.variant.value} {job.scenario.identity()}".encode()).hexdigest()
        file = f"{job.scenario.index:04d}_{job.variant.value}_{key[:16]}.npz"
        return str(PurePosixPath(REFERENCES, job.scenario.set_name, file))

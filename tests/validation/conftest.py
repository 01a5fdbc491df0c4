"""Seven scenes that highway-env has really run, one real study from the command line, and small traffic by hand."""

import contextlib
import dataclasses
import io
import json
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

SECONDS = 12
SCENES = {"stress10": (0, 1, 2), "multi10": (3, 15), "drivers10": (2, 6)}
"""Scenes by set. Among them are crashes, lane changes broken off, and every kind of vehicle."""


@pytest.fixture(scope="session")
def jobs():
    """The scenes to run, by set."""
    from rearl_jax.validation.scenarios import SETS
    from rearl_jax.validation.workers import Job, Variant

    return {
        chosen.name: [
            Job(chosen.scenario(index, seed=0, n_seconds=SECONDS), Variant.plain) for index in SCENES[chosen.name]
        ]
        for chosen in SETS
        if chosen.name in SCENES
    }


@pytest.fixture(scope="session")
def recorded(jobs):
    """highway-env's results by job; run in one worker process."""
    from rearl_jax.validation import workers

    return dict(workers.run([job for part in jobs.values() for job in part], 1))


@dataclass
class Replay:
    """Takes the place of the worker processes; holds the jobs asked for, fails once `broken_after` jobs are done."""

    recorded: dict
    asked: list = field(default_factory=list)
    broken_after: int | None = None

    def run(self, asked, n_workers):
        asked = list(asked)
        self.asked += asked
        for number, job in enumerate(asked):
            if number == self.broken_after:
                raise KeyboardInterrupt
            yield job, self.recorded[job]


@pytest.fixture
def replayed(recorded, monkeypatch):
    from rearl_jax.validation import workers

    replay = Replay(recorded)
    monkeypatch.setattr(workers, "run", replay.run)
    return replay


@dataclass(frozen=True)
class Done:
    """A run of `rearl validate`."""

    code: int
    printed: str
    said: str
    folder: Path

    @property
    def summary(self):
        return json.loads((self.folder / "summary.json").read_text())

    def table(self, name):
        return pd.read_parquet(self.folder / f"{name}.parquet")

    def reference_files(self):
        return sorted(str(path.relative_to(self.folder)) for path in (self.folder / "reference").rglob("*.*"))


@pytest.fixture(scope="session")
def validate():
    """The command line: `validate(root, *keys, stress10=3)`; sets that are not named have no scenes.

    Demands five lane changes, one broken off, and one crash, if the keys do not say otherwise.
    """
    from rearl_jax import cli, runtime
    from rearl_jax.config.validation import SceneCountsConfig

    def called(root, *keys, **scenes):
        counts = {field.name: scenes.get(field.name, 0) for field in fields(SceneCountsConfig)}
        words = ["validate", f"results.root={root}", f"validation.seconds={SECONDS}", "validation.workers=1"]
        words += [f"validation.scenes.{name}={count}" for name, count in counts.items()]
        words += [f"validation.least_{name}" for name in ("lane_changes=5", "aborts=1", "crashes=1")]
        printed, said, started = io.StringIO(), io.StringIO(), []
        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
            # JAX is set up for all tests already.
            patch.setattr(runtime, "start", lambda x64: started.append(x64))
            with contextlib.redirect_stderr(said):
                code = cli.main([*words, *keys])
        assert started in ([], [True])
        return Done(code, printed.getvalue(), said.getvalue(), Path(root) / "validate")

    return called


@pytest.fixture(scope="session")
def done(validate, recorded, jobs, tmp_path_factory):
    """A study of three scenes; where NumPy has vector functions, two of them really run both ways."""
    from rearl_jax.validation import workers
    from rearl_jax.validation.workers import Variant, vector_features

    both = [dataclasses.replace(job, variant=Variant.vectorised) for job in jobs["stress10"][:2]]
    replay = Replay(recorded | dict(workers.run(both if vector_features() else [], 1)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "run", replay.run)
        return validate(tmp_path_factory.mktemp("results"), "validation.control_share=0.5", stress10=3)


@pytest.fixture
def drive():
    """Three scenes of four vehicles, 31 steps, nothing crashed; vehicle 1 changes to lane 2 on tick 12."""
    from rearl_jax.validation.records import Tracks

    shape = (31, 4, 3)
    step = np.arange(31.0)[:, None, None]
    vehicle = np.arange(4)[:, None] + np.zeros((1, 3), int)
    lane = np.broadcast_to(vehicle % 4, shape).copy()
    lane[12:, 1] = 2
    target_lane = np.broadcast_to(vehicle % 4, shape).copy()
    target_lane[5:, 1] = 2
    return Tracks(
        x=30.0 * vehicle + (20.0 + vehicle) / 15 * step,
        y=4.0 * lane,
        heading=np.zeros(shape),
        speed=np.broadcast_to(20.0 + vehicle, shape).copy(),
        lane=lane,
        target_lane=target_lane,
        crashed=np.zeros(shape, bool),
    )


def plant(tracks, name, where, value):
    """The tracks with one array added to (or, of booleans, set) somewhere."""
    array = getattr(tracks, name).copy()
    array[where] = value if array.dtype == bool else array[where] + value
    return dataclasses.replace(tracks, **{name: array})


@pytest.fixture
def planted():
    return plant

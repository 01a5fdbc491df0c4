"""A small task of its own, `drive far`, with records of every kind of key."""

import sys
from dataclasses import dataclass
from enum import Enum
from types import ModuleType, SimpleNamespace

import pytest

from rearl_jax import tasks
from rearl_jax.problems import out_of_range
from rearl_jax.tasks import Task


@pytest.fixture
def cli(monkeypatch, tmp_path):
    """The module under test with the single task `drive far`, its conf/ folder, and what it was run with."""
    from rearl_jax import cli, runtime
    from rearl_jax.config._key import key

    class Side(Enum):
        left = "left"
        right = "right"

    @dataclass(unsafe_hash=True)
    class RoadConfig:
        """The road."""

        lanes: int = key(4, "number of lanes")
        length: float = key(400.0, "length [m]")
        exits: tuple[float, ...] = key((100.0, 200.0), "positions of the exits [m]")
        span: tuple[float, float] = key((0.0, 1.0), "first and last position [m]")

        def check(self) -> None:
            if self.lanes < 1:
                raise out_of_range("lanes", "must be at least 1", self.lanes)

    @dataclass(unsafe_hash=True)
    class ResultsConfig:
        """The folder of results."""

        root: str = key("results", "folder of all studies")
        resume: bool = key(False, "leave a finished study alone")

    @dataclass(unsafe_hash=True)
    class DriveTask:
        """A drive."""

        study: str = key("drive", "name of the study")
        side: Side = key(Side.right, "side of the road that is driven on")
        limit: float | None = key(None, "speed limit [m/s]; null is none")
        road: RoadConfig = key(RoadConfig, "the road")
        results: ResultsConfig = key(ResultsConfig, "results")

    ran = []

    def run(config) -> dict:
        if config.road.lanes == 9:
            module.fail()
        ran.append(config)
        return {}

    collected = []
    module = ModuleType("drive_task")
    module.DriveTask, module.run = DriveTask, run
    module.collect = lambda config, cells: collected.append((config, cells))
    monkeypatch.setitem(sys.modules, "drive_task", module)
    task = Task(
        words="drive far",
        run="drive_task:run",
        config="drive_task:DriveTask",
        summary="drive along",
        description="Drives along a road.",
        examples=("rearl drive far road.lanes=2",),
        collect="drive_task:collect",
        implied={"road": "limit=50"},
    )
    conf = tmp_path / "conf"
    (conf / "road").mkdir(parents=True)
    (conf / "drive_far.yaml").write_text("defaults: [schema, road: narrow, _self_]\n")
    (conf / "road" / "narrow.yaml").write_text("# one lane each way\nlanes: 2\n")
    (conf / "road" / "wide.yaml").write_text("lanes: 6\nlength: 900\n")
    sweeps = tmp_path / "sweeps"
    sweeps.mkdir()
    (sweeps / "sides.yaml").write_text("# both sides\ntask: drive far\nkeys:\n  limit: 20\n  side: left,right\n")
    (sweeps / "other.yaml").write_text("# of another task\ntask: fly\nkeys: {}\n")
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setattr(tasks, "TASKS", (task,))
    monkeypatch.setattr(tasks, "conf_dir", lambda: conf)
    monkeypatch.setattr(tasks, "sweeps_dir", lambda: sweeps)
    started = []
    monkeypatch.setattr(runtime, "start", lambda x64: started.append(x64))
    seen = {"ran": ran, "started": started, "collected": collected}
    return SimpleNamespace(main=cli.main, task=module, Side=Side, work=work, **seen)

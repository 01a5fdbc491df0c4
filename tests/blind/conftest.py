"""Small data sets, simulated once."""

import json
import subprocess
import sys
from functools import cache

import pytest


@pytest.fixture(scope="session")
def run_blind():
    """Runs a blind study with the real discovery, as a user does, and gives back its summary."""

    def run(root, name, *keys):
        words = ["discover", "blind", *keys, f"study={name}", f"results.root={root}"]
        command = [sys.executable, "-m", "rearl_jax", *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=1800)
        assert done.returncode == 0, done.stderr[-3000:]
        return json.loads((root / name / "summary.json").read_text(encoding="utf-8"))

    return run


@pytest.fixture(scope="session")
def simulated():
    """Events of one recording without driver noise, with one thing hidden."""

    @cache
    def run(scenario):
        from rearl_jax.blind.traffic.simulation import simulate

        return simulate(scenario)

    def simulated(name: str | None = None, strength: float = 1.0, **changes):
        from rearl_jax.blind.traffic import Planted, Scenario

        keys = {"n_recordings": 1, "duration": 25.0, "driver_noise": 0.0} | changes
        return run(Scenario(4, () if name is None else (Planted(name, strength),), **keys))

    return simulated


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """Root of the results of a finished study, its summary."""
    from rearl_jax.blind.task import run_with
    from tests.blind.stub_study import Stub, task

    root = tmp_path_factory.mktemp("results")
    return root, run_with(task(root), Stub(root / "asked.txt"))

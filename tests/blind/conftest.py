"""Small data sets, simulated once."""

from functools import cache

import pytest


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

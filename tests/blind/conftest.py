"""Small data sets, simulated once, and a study of them."""

from functools import cache

import pytest


@pytest.fixture(scope="session")
def simulated():
    """Events of one recording without driver noise, with one thing hidden."""

    @cache
    def run(name: str | None = None, strength: float = 1.0, **changes):
        from rearl_jax.blind.traffic import Planted, Scenario
        from rearl_jax.blind.traffic.simulation import simulate

        keys = {"n_recordings": 1, "duration": 25.0, "driver_noise": 0.0} | changes
        planted = () if name is None else (Planted(name, strength),)
        return simulate(Scenario(4, planted, **keys))

    return run


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """Root of a finished study in whose verdicts an effect too many is named, and its summary."""
    from rearl_jax.blind.task import run_with
    from tests.blind.stub_study import Stub, task

    root = tmp_path_factory.mktemp("results")
    return root, run_with(task(root), Stub(root / "asked.txt"))

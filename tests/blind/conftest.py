"""Small data sets, simulated once."""

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

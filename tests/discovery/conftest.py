"""Small generated data sets and what was measured in them, each made once."""

from functools import cache

import pytest


@pytest.fixture(scope="session")
def folder_of(tmp_path_factory):
    """Folder of a data set of three recordings with one thing hidden."""

    @cache
    def make(name: str | None = None, strength: float = 1.0, **changes):
        from rearl_jax.blind.traffic import Planted, Scenario
        from rearl_jax.blind.traffic.dataset import write_dataset

        folder = tmp_path_factory.mktemp("data")
        planted = () if name is None else (Planted(name, strength),)
        usual = {"seed": 11, "planted": planted, "n_vehicles": 15, "duration": 40.0}
        write_dataset(folder, Scenario(**(usual | changes)))
        return folder

    return make


@pytest.fixture(scope="session")
def recordings_of(folder_of):
    """Recordings of such a data set."""

    @cache
    def read(name: str | None = None, strength: float = 1.0, **changes):
        from rearl_jax.config.data import DataConfig, DataFormat
        from rearl_jax.data.recordings import iterate_recordings

        folder = folder_of(name, strength, **changes)
        return tuple(iterate_recordings(DataConfig(format=DataFormat.table, root=str(folder))))

    return read


@pytest.fixture(scope="session")
def keep_right(recordings_of):
    """Recordings of drivers who change lanes freely and keep right."""
    from rearl_jax.blind.traffic.scenario import FREE_CHANGES

    return recordings_of("keep_right", **{**FREE_CHANGES, "n_vehicles": 180, "duration": 150.0})


@pytest.fixture(scope="session")
def lane_findings(keep_right):
    """Preferences of drivers who keep right."""
    from rearl_jax.discovery.lane_changes import lane_change_findings

    return lane_change_findings(keep_right)


@pytest.fixture(scope="session")
def tables_of(recordings_of):
    """Tables of such a data set with as few time steps as are enough."""

    @cache
    def thin(name: str | None = None, strength: float = 1.0, **changes):
        from rearl_jax.discovery.read.smoothing import thinned

        return tuple(map(thinned, recordings_of(name, strength, **changes)))

    return thin


@pytest.fixture(scope="session")
def measured_of(tables_of):
    """Measured drivers of the first recording."""

    @cache
    def measure_first(name: str | None = None, strength: float = 1.0, **changes):
        from rearl_jax.discovery.read.reading import measure

        return measure(tables_of(name, strength, **changes)[:1])

    return measure_first


@pytest.fixture(scope="session")
def solver(measured_of):
    """A solver for the control."""
    from rearl_jax.discovery.observe.solver import solver_of

    data = measured_of()
    return solver_of(data)


@pytest.fixture(scope="session")
def calibrated(solver, measured_of):
    """The control, calibrated, and its noise."""
    from rearl_jax.discovery.observe.noise import calibrate

    return calibrate(solver, measured_of())


def copied(solver, calibrated, n_doublings):
    """The calibrated drivers several times, and their noise."""
    import numpy as np

    from rearl_jax.discovery.observe.fit_state import new_state, replaced

    state, noise = calibrated
    data, z = state.data, state.z
    for _ in range(n_doublings):
        data, z = data.with_drivers(data), np.concatenate([z, z])
    more = new_state(data, solver.layout, noise)
    return replaced(more, z=z, mean=state.mean, spread=state.spread, theta=state.theta, active=state.active), noise


@pytest.fixture(scope="session")
def several(solver, calibrated):
    """Twice the calibrated drivers, and their noise."""
    return copied(solver, calibrated, 1)


@pytest.fixture(scope="session")
def many(solver, calibrated):
    """Eight times the calibrated drivers, and their noise."""
    return copied(solver, calibrated, 3)

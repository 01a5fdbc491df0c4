"""Small dense traffic in which episodes end soon, for all tests alike so that it is compiled once."""

import pytest


@pytest.fixture(scope="session")
def small():
    """Options of the environments."""
    return {"n_others": 4, "density": 3.0, "duration": 6}


@pytest.fixture(scope="session")
def functional(small):
    """The functional environment."""
    from rearl_jax.environments.functional import FunctionalHighway

    return FunctionalHighway(**small)


@pytest.fixture(scope="session")
def us101():
    """The scenes of the shipped recordings."""
    from rearl_jax.config import PrepareTask
    from rearl_jax.data.recordings import iterate_recordings
    from rearl_jax.data.scenes.cutting import build_scenes

    config = PrepareTask()
    return build_scenes(iterate_recordings(config.data), config)

"""Dense traffic of all kinds to look at and to drive in."""

from functools import partial

import numpy as np
import pytest

N_VEHICLES, N_SCENARIOS = 10, 12


@pytest.fixture(scope="session")
def model():
    from rearl_jax.core.model import TrafficModel

    return TrafficModel(collisions=False, lane_changes=False)


@pytest.fixture(scope="session")
def start(model):
    """Drawn traffic and its drivers."""
    import jax

    from rearl_jax.core.spawn import spawn

    return spawn(jax.random.split(jax.random.key(4), N_SCENARIOS), model, n_vehicles=N_VEHICLES, density=2.0)


@pytest.fixture(scope="session")
def wild(model):
    """Vehicles anywhere and anyhow: off their lanes, turned, some crashed, some absent, some far away."""
    import jax.numpy as jnp

    from rearl_jax.core.state import Controller, make_state

    rng = np.random.default_rng(5)
    shape = (N_VEHICLES, N_SCENARIOS)
    state = make_state(
        rng.uniform(100.0, 500.0, shape),
        rng.uniform(-3.0, 15.0, shape),
        rng.uniform(0.0, 40.0, shape),
        model,
        heading=rng.uniform(-0.5, 0.5, shape),
        target_lane=rng.integers(0, 4, shape),
        controller=np.where(rng.random(shape) < 0.2, Controller.ABSENT, Controller.META),
        crashed=rng.random(shape) < 0.2,
        dtype=np.float64,
    )
    assert isinstance(state.x, jnp.ndarray)
    return state


@pytest.fixture(scope="session")
def network():
    """Random weights whose logits differ."""
    import equinox as eqx
    import jax

    from rearl_jax.baselines.network import make_network

    network = jax.jit(partial(make_network, width=16, layers=2))(jax.random.key(8))
    return eqx.tree_at(lambda n: n.actor.layers[-1].weight, network, replace_fn=lambda weight: 300 * weight)


@pytest.fixture
def lenient():
    """JAX's usual promotion of types: optax raises a float to the power of an integer."""
    import jax

    with jax.numpy_dtype_promotion("standard"):
        yield


@pytest.fixture(scope="session")
def tiny():
    """A training that takes no time: four updates of 96 vehicle-seconds."""
    from rearl_jax.config import TrainPpoTask
    from rearl_jax.config.core import CoreConfig
    from rearl_jax.config.ppo import PpoConfig

    ppo = PpoConfig(scenarios=4, horizon=6, car_steps=384.0, width=8, minibatch=24, epochs=3, checkpoint_every=2)
    core = CoreConfig(n_vehicles=4, collisions=False, lane_changes=False)
    return TrainPpoTask(ppo=ppo, core=core)

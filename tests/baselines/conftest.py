"""Dense traffic to drive in."""

from functools import partial

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

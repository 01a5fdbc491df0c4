"""Two small scenes to replay: vehicles that drift, one that crashes, one that is asked."""

import numpy as np
import pytest

from tests.evaluation.conftest import made_scenes


@pytest.fixture
def replay():
    """Vehicle 0 crashes in the ninth second; vehicle 1 is told something else in each second."""
    import jax
    import jax.numpy as jnp

    from rearl_jax.config import EvaluateTask
    from rearl_jax.config.core import CoreConfig
    from rearl_jax.core.rollout import Frames
    from rearl_jax.replay.scenes import Decision, Replay, ReplayedScene

    scenes = made_scenes()
    second, vehicle = np.mgrid[: scenes.seconds, : scenes.n_slots].astype(float)
    frames = Frames(
        x=jnp.asarray(30.0 * vehicle + 20.0 * second),
        y=jnp.asarray(4.0 * vehicle),
        heading=jnp.zeros(second.shape),
        speed=jnp.full(second.shape, 20.0),
        acceleration=jnp.zeros(second.shape),
        lane=jnp.asarray(vehicle, jnp.int32),
        crashed=jnp.asarray((vehicle == 0) & (second >= 8)),
    )
    decisions = tuple(Decision(0, number, 1, number % 6 - 1) for number in range(scenes.seconds))
    frames = jax.tree.map(np.asarray, frames)
    replayed = (ReplayedScene(index, 0, frames, np.full(scenes.n_slots, 5.0), 0.25, decisions) for index in (1, 4))
    config = EvaluateTask(core=CoreConfig(n_vehicles=scenes.n_slots))
    return Replay(config, scenes, tuple(replayed), "Made for a test.", has_decisions=True)

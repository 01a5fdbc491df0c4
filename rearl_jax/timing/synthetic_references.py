"""References drawn from a seed, as large as those of recordings, so that a measurement reads no data.

They determine the amount of work, but are not realistic: traffic compared with them only yields costs.
"""

import jax.numpy as jnp
import numpy as np

from rearl_jax.data.scenes.scene_set import SPEED_RANGE
from rearl_jax.data.scenes.scene_windows import actions
from rearl_jax.detection.references import References

FLOW_SPEEDS = (10.0, 30.0)
"""Range of the mean speeds of the references, from congested to free [m/s]."""

SPACINGS = (30.0, 160.0)
"""Range of the mean distances between vehicles of the references [m]; a camera sees about 400 m of road."""

LANE_CHANGE_SHARE = 0.01
"""Share of the vehicles that change lanes in a second [-], of the order of magnitude of measured shares."""

N_LANES = 4
"""Number of lanes of the references."""


def synthetic_references(seed: int, n_references: int, n_seconds: int, n_vehicles: int) -> References:
    """References whose speeds and spacings wander slowly about levels of their own, all equally frequent."""
    random = np.random.default_rng(seed)
    # One second more, because the action in the last second follows from the state after it.
    shape = (n_references, n_seconds + 1, n_vehicles)
    of_scene, of_vehicle = (n_references, 1, 1), (n_references, 1, n_vehicles)
    speed = random.uniform(*FLOW_SPEEDS, of_scene) + random.normal(0, 3, of_vehicle)
    speed = np.clip(speed + np.cumsum(random.normal(0, 0.4, shape), axis=1), *SPEED_RANGE)
    shift = random.choice([-1, 0, 1], shape, p=[LANE_CHANGE_SHARE / 2, 1 - LANE_CHANGE_SHARE, LANE_CHANGE_SHARE / 2])
    lane = np.clip(random.integers(0, N_LANES, of_vehicle) + np.cumsum(shift, axis=1), 0, N_LANES - 1)
    spacing = random.uniform(*SPACINGS, of_scene) * random.uniform(0.7, 1.4, of_vehicle)
    spacing = (spacing * np.exp(np.cumsum(random.normal(0, 0.02, shape), axis=1)))[:, :-1]
    action = actions(lane[:, :-1], lane[:, 1:], speed[:, :-1], speed[:, 1:])
    return References(
        speed=jnp.asarray(speed[:, :-1], jnp.float32),
        spacing=jnp.asarray(spacing, jnp.float32),
        mean_spacing=jnp.asarray(spacing.mean(axis=-1), jnp.float32),
        action=jnp.asarray(action, jnp.int32),
        share=jnp.full(n_references, 1 / n_references, jnp.float32),
    )

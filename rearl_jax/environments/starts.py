"""Measured scenes as initial states of episodes: every vehicle of every scene is once the controlled one."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from rearl_jax.config.core import CoreConfig, Precision
from rearl_jax.core.state import Controller, TrafficState, nearest_level
from rearl_jax.data.scenes.initial_states import first_lanes, measured_state
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.environments.highway import EGO, HighwayOptions


def with_scenes(options: HighwayOptions, scenes: SceneSet | None) -> tuple[HighwayOptions, TrafficState | None]:
    """The options with as many lanes as the scenes need, and the scenes' beginnings, the last axis over the cases.

    The cases go through the vehicles of the first scene, then of the second; the order of the others stays, behind the
    controlled one and then from the front of the list. Speeds are the rescaled ones (`SceneSet.scaled_speed`).

    Args:
        options: The environment.
        scenes: Measured scenes; None for none, and nothing changes.

    Raises:
        ValueError: The road has too few lanes for them, or a lane is unknown.
    """
    if scenes is None:
        return options, None
    if options.n_lanes is None:
        options = replace(options, n_lanes=int(first_lanes(scenes).max()) + 1)
    core = CoreConfig(
        n_lanes=options.model.n_lanes,
        n_vehicles=scenes.n_slots,
        ticks_per_second=options.ticks_per_second,
        dtype=Precision[options.dtype],
    )
    state = measured_state(scenes, core)
    turns = (np.arange(scenes.n_slots)[:, None] + np.arange(scenes.n_slots)) % scenes.n_slots  # [row, vehicle in row 0]
    state = jax.tree.map(lambda leaf: jnp.moveaxis(leaf[turns], 1, -1).reshape(scenes.n_slots, -1), state)
    levels = jnp.asarray(options.speed_levels, state.x.dtype)
    target = levels[nearest_level(state.speed[EGO], options.model).astype(jnp.int32)]
    return options, replace(
        state,
        desired_speed=state.desired_speed.at[EGO].set(target),
        controller=state.controller.at[EGO].set(int(Controller.META)),
        order=jnp.argsort(state.x, axis=0).astype(jnp.int32),
    )

"""Meta-actions: lane and speed level that a vehicle is to reach, chosen once a second.

Source: highway-env 1.12.1, `MDPVehicle.act` and `ControlledVehicle.act`.
"""

import enum

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.mobil import is_reachable
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, TrafficState, nearest_level


class MetaAction(enum.IntEnum):
    """Identifiers of the five actions, as in highway-env."""

    LANE_LEFT = 0
    IDLE = 1
    LANE_RIGHT = 2
    FASTER = 3
    SLOWER = 4


def apply_meta_actions(
    state: TrafficState, actions: Int[Array, "vehicles *scenarios"], model: TrafficModel
) -> TrafficState:
    """State with new target lanes and target speeds of the META vehicles; all others keep theirs.

    FASTER and SLOWER go one level up or down from the level nearest to the present speed. Lane actions move the target
    lane, so repeated ones add up; a lane out of reach is ignored.
    """
    is_meta = state.controller == Controller.META
    shift = jnp.where(actions == MetaAction.FASTER, 1, jnp.where(actions == MetaAction.SLOWER, -1, 0))
    level = jnp.clip(nearest_level(state.speed, model).astype(jnp.int32) + shift, 0, len(model.speed_levels) - 1)
    speed = _level_speed(level, state.speed, model)
    side = jnp.where(actions == MetaAction.LANE_LEFT, -1, jnp.where(actions == MetaAction.LANE_RIGHT, 1, 0))
    lane = jnp.clip(state.target_lane + side, 0, model.n_lanes - 1)
    changes_lane = is_meta & (side != 0) & is_reachable(state, lane, model)
    return eqx.tree_at(
        lambda s: (s.desired_speed, s.target_lane),
        state,
        (
            jnp.where(is_meta & (shift != 0), speed, state.desired_speed),
            jnp.where(changes_lane, lane, state.target_lane),
        ),
    )


def _level_speed(level: Int[Array, "*n"], like: Float[Array, "*n"], model: TrafficModel) -> Float[Array, "*n"]:
    """Speed of a level [m/s], exactly as configured."""
    speed = jnp.full_like(like, model.speed_levels[0])
    for index, value in enumerate(model.speed_levels):
        speed = jnp.where(level == index, value, speed)
    return speed

"""Reward for driving fast, on the right lanes and without a crash."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.elementary import cosine
from rearl_jax.core.model import ROAD_END_MARGIN, TrafficModel
from rearl_jax.core.state import TrafficState, nearest_lane

CRASH_WEIGHT, RIGHT_LANE_WEIGHT, HIGH_SPEED_WEIGHT = -1.0, 0.1, 0.4
"""Weights of the parts of the reward. Source: highway-env 1.12.1, `HighwayEnv.default_config`."""

REWARDED_SPEEDS = (20.0, 30.0)
"""Speeds along the road [m/s] up to which no speed is rewarded, and from which on the reward is complete.

Source: highway-env 1.12.1, `reward_speed_range`.
"""


def reward(state: TrafficState, model: TrafficModel) -> Float[Array, "vehicles scenarios"]:
    """Reward of every vehicle for the second that ends in a state, within [0, 1].

    R = -1 [crashed] + 0.1 lane / (lanes - 1) + 0.4 clip((v - 20) / 10, 0, 1), its range [-1, 0.5] mapped to [0, 1];
    0 off the road. The lane is the target lane, counted from the left; v is the speed along the road.

    Source: highway-env 1.12.1, `HighwayEnv._reward` and `HighwayEnv._rewards`.
    """
    dtype = state.speed.dtype
    low, high = REWARDED_SPEEDS
    lane = state.target_lane.astype(dtype) / max(model.n_lanes - 1, 1)
    speed = jnp.clip((state.speed * cosine(state.heading) - low) / (high - low), 0.0, 1.0)
    total = CRASH_WEIGHT * state.crashed.astype(dtype) + RIGHT_LANE_WEIGHT * lane + HIGH_SPEED_WEIGHT * speed
    offset = state.y - nearest_lane(state.y, model).astype(dtype) * model.lane_width
    is_along_road = (state.x >= -ROAD_END_MARGIN) & (state.x < model.road_length + ROAD_END_MARGIN)
    on_road = is_along_road & (jnp.abs(offset) <= model.lane_width / 2)
    return jnp.where(on_road, (total - CRASH_WEIGHT) / (HIGH_SPEED_WEIGHT + RIGHT_LANE_WEIGHT - CRASH_WEIGHT), 0.0)

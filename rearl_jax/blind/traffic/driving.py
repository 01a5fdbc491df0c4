"""Car following in the generator: the car-following model with all hidden effects, and emergency braking."""

from collections.abc import Sequence

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.snapshot import Snapshot

HARDEST = 8.0
"""Deceleration on dry asphalt [m/s^2]."""

LAST_METRE = 1.0
"""Gap [m] that remains after an emergency stop."""


def wanted_acceleration(now: Snapshot, effects: Sequence[HiddenEffect]) -> np.ndarray:
    """Acceleration of the model with all hidden effects [m/s^2], before noise and emergency braking."""
    fleet, speed = now.fleet, now.speed[: now.n]
    gap, dv = now.gap_to(now.leader), speed - now.speed[now.leader]
    now.time_gap, now.desired_speed = fleet.time_gap, fleet.desired_speed
    for effect in effects:
        gap, dv = effect.perceive(gap, dv, now)
        now.time_gap = effect.time_gap(now.time_gap, now)
        now.desired_speed = effect.desired_speed(now.desired_speed, now)
    interaction = now.interaction(gap, dv)
    for effect in effects:
        interaction = effect.interaction(interaction, now)
    value = now.model.acceleration(now.drivers(), interaction)
    for effect in effects:
        value = effect.acceleration(value, now)
    for effect in effects:
        value = effect.respond(value, now)
    return value


def with_emergencies(value: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations that avoid collisions [m/s^2], and which vehicles have an emergency.

    An emergency occurs if a driver who brakes at HARDEST would stop less than LAST_METRE behind the stopping point of
    the leader (Gipps, Transp. Res. B 15 (1981) 105, without reaction time). IDM without noise and hidden effects never
    has one.
    """
    ahead = now.gap_to(now.leader) + now.speed[now.leader] ** 2 / (2.0 * HARDEST)
    is_emergency = now.speed[: now.n] ** 2 / (2.0 * HARDEST) + LAST_METRE > ahead
    return np.where(is_emergency, -HARDEST, np.maximum(value, -HARDEST)), is_emergency

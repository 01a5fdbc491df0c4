"""Checks that simulated motion is plausible traffic and that the hidden effect acts in it.

Followers are all vehicles except the platoon leaders, whose speeds are prescribed.
"""

import numpy as np

from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.simulation import Events

SAMPLING_TIME = 0.5
"""Time from one checked time step to the next [s]."""

STANDING_SPEED, LARGEST_STANDING_SHARE = 0.3, 0.5
"""Speed [m/s] below which a vehicle counts as standing, and largest share of the followers' time spent standing."""

CLOSE_TIME_GAP, LEAST_CLOSE_SHARE = 6.0, 0.3
"""Time gap [s] up to which a leader influences a driver, and least share of the followers' time at shorter gaps."""

LARGEST_EMERGENCY_SHARE = 0.0005
"""Largest share of the followers' time spent braking in an emergency."""

LEAST_EFFECT_SIZE = 0.02
"""Least root mean square of the accelerations that hidden effects cause [m/s^2]."""

REASONS = (
    "invalid",  # a position or speed is not finite
    "collision",  # vehicles overlap
    "standing",  # followers stand for most of the time
    "free",  # followers are seldom influenced by a leader
    "emergencies",  # followers often brake as hard as they can
    "no_effect",  # the hidden effect hardly changes the accelerations
)
"""Reasons to reject a data set and to draw another."""


def fault_of(scenario: Scenario, events: Events) -> str | None:
    """The first of REASONS that applies; None if the motion is plausible traffic."""
    recorded = np.flatnonzero((events.time >= 0.0) & (events.time <= scenario.duration))
    steps = recorded[:: max(1, round(SAMPLING_TIME / (events.time[1] - events.time[0])))]
    position, speed = events.position[steps], events.speed[steps]
    if not (np.isfinite(events.position).all() and np.isfinite(events.speed).all()):
        return "invalid"
    gap = _gaps(events, steps)
    if (gap < 0.0).any():
        return "collision"
    is_follower = events.fleet.rank > 0  # a platoon leader has rank 0
    of_followers = np.broadcast_to(is_follower, position.shape)
    if np.mean(speed[of_followers] < STANDING_SPEED) > LARGEST_STANDING_SHARE:
        return "standing"
    if np.mean((gap / np.maximum(speed, 1.0))[of_followers] < CLOSE_TIME_GAP) < LEAST_CLOSE_SHARE:
        return "free"
    if events.n_emergencies > LARGEST_EMERGENCY_SHARE * len(events.time) * np.count_nonzero(is_follower):
        return "emergencies"
    return "no_effect" if scenario.planted and events.effect_size < LEAST_EFFECT_SIZE else None


def _gaps(events: Events, steps: np.ndarray) -> np.ndarray:
    """Gap to the vehicle ahead on the lane [m] at the given time steps, `[steps, vehicles]`; inf if there is none."""
    gaps = np.full((len(steps), events.position.shape[1]), np.inf)
    for row, step in enumerate(steps):
        position, lane = events.position[step], events.lane[step]
        group = events.fleet.recording * (int(events.lane.max()) + 1) + lane
        order = np.lexsort((position, group))
        is_same = group[order[1:]] == group[order[:-1]]
        behind, ahead = order[:-1][is_same], order[1:][is_same]
        half_lengths = 0.5 * (events.fleet.length[ahead] + events.fleet.length[behind])
        gaps[row, behind] = position[ahead] - position[behind] - half_lengths
    return gaps

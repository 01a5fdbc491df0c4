"""Tests that simulated motion is plausible traffic and that the hidden effect acts in it."""

import numpy as np

from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.simulation import Events

EVERY = 0.5
"""Time between two examined moments [s]."""

STANDING, MOST_STANDING = 0.3, 0.5
"""Speed [m/s] below which a vehicle stands, and largest share of the followers' time that is standing."""

NEAR, LEAST_FOLLOWED = 6.0, 0.3
"""Time gap [s] within which a driver follows, and least share of the followers' time that is following."""

MOST_EMERGENCIES = 0.0005
"""Largest share of the followers' time with emergency braking."""

LEAST_EFFECT = 0.02
"""Least root mean square of the acceleration that hidden effects cause [m/s^2]."""

REASONS = ("invalid", "collision", "standing", "free", "emergencies", "no_effect")
"""Reasons to draw a data set again: motion is not finite, vehicles overlap, most stand, few follow, many brake as
hard as they can, the hidden effect does not act.
"""


def fault_of(scenario: Scenario, events: Events) -> str | None:
    """The first of REASONS that applies, None for traffic."""
    inside = np.flatnonzero((events.time >= 0.0) & (events.time <= scenario.duration))
    moments = inside[:: max(1, round(EVERY / (events.time[1] - events.time[0])))]
    position, speed = events.position[moments], events.speed[moments]
    if not (np.isfinite(events.position).all() and np.isfinite(events.speed).all()):
        return "invalid"
    gap = _gaps(events, moments)
    if (gap < 0.0).any():
        return "collision"
    follows = np.broadcast_to(events.fleet.rank > 0, position.shape)
    if np.mean(speed[follows] < STANDING) > MOST_STANDING:
        return "standing"
    if np.mean((gap / np.maximum(speed, 1.0))[follows] < NEAR) < LEAST_FOLLOWED:
        return "free"
    if events.n_emergencies > MOST_EMERGENCIES * len(events.time) * np.count_nonzero(events.fleet.rank > 0):
        return "emergencies"
    return "no_effect" if scenario.planted and events.effect_size < LEAST_EFFECT else None


def _gaps(events: Events, moments: np.ndarray) -> np.ndarray:
    """Gap to the vehicle ahead on the lane [m], [n_moments, n]; infinite without one."""
    gaps = np.full((len(moments), events.position.shape[1]), np.inf)
    for row, moment in enumerate(moments):
        position, lane = events.position[moment], events.lane[moment]
        group = events.fleet.recording * (int(events.lane.max()) + 1) + lane
        order = np.lexsort((position, group))
        same = group[order[1:]] == group[order[:-1]]
        behind, ahead = order[:-1][same], order[1:][same]
        half = 0.5 * (events.fleet.length[ahead] + events.fleet.length[behind])
        gaps[row, behind] = position[ahead] - position[behind] - half
    return gaps

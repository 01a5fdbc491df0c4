"""Lateral behaviour of the generated drivers: lane-change decisions and lateral motion.

Drivers change left for a gain in speed and return to the right when they lose little speed by it (the German rule
to keep right). A change happens at a random moment with a rate that grows with the incentive, if the gaps in
the target lane suffice. The constants are assumed; the rates are fitted to highD's number of lane changes.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.data.generator.fleet import Drivers, Fleet, Situation

LEFT, RIGHT = -1, 1
# Drivers estimate the speed in a lane over a horizon, which is longer for returning to the right, so that they do not
# change back and forth.
GAIN_HORIZON, RETURN_HORIZON = 8.0, 14.0  # [s]
GAIN_THRESHOLD = 1.5  # smallest gain that moves a driver to the left [m/s]
GAIN_SCALE = 6.0  # gain beyond the threshold at which the full rate is reached; at 1.5 times it 2.25 full rates [m/s]
LOSS_TOLERANCE = 0.3  # loss a driver accepts for returning to the right [m/s]
RETURN_RATE = 0.11  # rate of returning, relative to the full rate of changing left
QUEUE_SPEED = 16.7  # below this speed (60 km/h) drivers need not keep right and may pass on either side [m/s]
PAUSE = 4.0  # shortest time between two changes of a driver [s]
WIDEST_VEHICLE = 2.50  # [m]
LATERAL_LIMIT = 0.40  # largest offset from the lane centre [m]


@dataclass(frozen=True)
class Neighbours:
    """Leader and follower of every driver in a possible target lane: gap [m], speed [m/s]; without one, gap inf."""

    gap_ahead: np.ndarray
    speed_ahead: np.ndarray
    gap_behind: np.ndarray
    speed_behind: np.ndarray


def expected_speed(
    desired_speed: np.ndarray,
    speed: np.ndarray,
    gap: np.ndarray,
    leader_speed: np.ndarray,
    time_gap: np.ndarray,
    horizon: float,
) -> np.ndarray:
    """Mean speed that a driver expects in a lane over the horizon [m/s]: at most the desired speed, and so high that
    the gap shrinks to the time gap behind the leader within the horizon.
    """
    room = np.maximum(gap - time_gap * speed, 0.0)
    return np.minimum(desired_speed, leader_speed + room / horizon)


def accepts_gaps(speed: np.ndarray, target: Neighbours, drivers: Drivers) -> np.ndarray:
    """Mask of drivers for whom the gaps in the target lane suffice.

    The gap to the vehicle ahead must exceed s0 + T_c v (jam gap, critical time gap and speed) plus the distance lost
    while slowing to its speed at comfortable deceleration; the gap to the one behind the same with that one's speed,
    plus the distance lost in the reaction time.

    Source: gap acceptance with a critical gap per driver, as in Gipps (1986), A model for the structure of
    lane-changing decisions.
    """
    closing = np.maximum(speed - target.speed_ahead, 0.0)
    ahead = drivers.jam_gap + drivers.critical_gap * speed + closing**2 / (2.0 * drivers.comfort_decel)
    closing = np.maximum(target.speed_behind - speed, 0.0)
    behind = (
        drivers.jam_gap
        + drivers.critical_gap * target.speed_behind
        + closing * drivers.reaction_time
        + closing**2 / (2.0 * drivers.comfort_decel)
    )
    return (target.gap_ahead > ahead) & (target.gap_behind > behind)


def change_probability(
    side: int,
    situation: Situation,
    target: Neighbours,
    desired_speed: np.ndarray,
    rate: float,
    duration: float,
) -> np.ndarray:
    """Probability of beginning a change to one side within the duration [s], if the gaps suffice.

    `rate` is the full lane-change rate [1/s], which a large incentive causes.
    """
    fleet = situation.fleet
    drivers, speed = fleet.drivers, fleet.speed
    horizon = GAIN_HORIZON if side == LEFT else RETURN_HORIZON
    own_speed_ahead = np.where(np.isfinite(situation.gap), situation.leader_speed, desired_speed)
    here = expected_speed(desired_speed, speed, situation.gap, own_speed_ahead, drivers.time_gap, GAIN_HORIZON)
    there = expected_speed(desired_speed, speed, target.gap_ahead, target.speed_ahead, drivers.time_gap, horizon)
    gain = there - here
    if side == LEFT:
        share = _urgency(gain)
    else:
        keep_right = np.where((-gain < LOSS_TOLERANCE) & (speed > QUEUE_SPEED), RETURN_RATE, 0.0)
        in_queue = _urgency(gain) * (speed <= QUEUE_SPEED)
        share = np.maximum(keep_right, in_queue)
    return -np.expm1(-rate * duration * share * drivers.eagerness)


def _urgency(gain: np.ndarray) -> np.ndarray:
    """Factor on the full rate at a gain in speed [m/s]; quadratic, so small gains rarely cause a change."""
    return np.clip((gain - GAIN_THRESHOLD) / GAIN_SCALE, 0.0, 1.5) ** 2


def lateral_shape(progress: np.ndarray) -> np.ndarray:
    """Share of a lane change's lateral distance covered after a share p of its duration: 10 p^3 - 15 p^4 + 6 p^5.

    Lateral speed and acceleration are 0 at both ends.

    Source: minimum-jerk path, usual for lane changes.
    """
    p = np.clip(progress, 0.0, 1.0)
    return p**3 * (10.0 - 15.0 * p + 6.0 * p**2)


def lateral_position(fleet: Fleet, time: float, lane_width: float) -> np.ndarray:
    """Distance of the vehicle centre from the left edge of the carriageway [m]."""
    progress = (time - fleet.change_start) / fleet.drivers.change_duration
    remaining = fleet.change_shift * (1.0 - lateral_shape(progress))
    offset = np.clip(fleet.drivers.lateral_bias + fleet.lateral_offset, -LATERAL_LIMIT, LATERAL_LIMIT)
    return (fleet.lane + 0.5) * lane_width + remaining + offset


def has_left_origin(fleet: Fleet, lateral: np.ndarray, lane_width: float) -> np.ndarray:
    """Mask of vehicles so far out of their lane of origin that any other may pass them there."""
    distance = np.abs(lateral - (fleet.origin + 0.5) * lane_width)
    return distance > 0.5 * (fleet.drivers.width + WIDEST_VEHICLE) + LATERAL_LIMIT

"""Longitudinal behaviour of the generated drivers: Gipps' free and safe speed, a time gap per driver, mild braking.

All functions are element-wise over drivers. Decelerations are positive magnitudes. In formulas v is the speed, v0 the
desired speed, vl the leader's speed, s the gap, s0 `jam_gap`, T `time_gap`, tau `reaction_time`, a `max_accel` and b
`braking`.
"""

import numpy as np

from rearl_jax.data.generator.fleet import Drivers

EMERGENCY_DECEL = 8.5  # strongest deceleration [m/s^2]: tyre grip on a dry road
KINEMATIC_MARGIN = 1.3  # safety factor on the deceleration that just avoids a collision [-]


def free_speed(speed: np.ndarray, desired_speed: np.ndarray, drivers: Drivers) -> np.ndarray:
    """Speed one reaction time ahead on an empty road [m/s].

    v + 2.5 a tau (1 - v/v0) sqrt(0.025 + v/v0)

    Source: Gipps (1981), A behavioural car-following model for computer simulation, eq. 2.
    """
    a, tau = drivers.max_accel, drivers.reaction_time
    ratio = speed / desired_speed
    return speed + 2.5 * a * tau * (1.0 - ratio) * np.sqrt(0.025 + ratio)


def safe_speed(speed: np.ndarray, gap: np.ndarray, leader_speed: np.ndarray, drivers: Drivers) -> np.ndarray:
    """Speed one reaction time ahead from which the driver can stop behind a braking leader [m/s].

    -b (tau/2 + theta) + sqrt(b^2 (tau/2 + theta)^2 + 2 b (s - s0) - b tau v + vl^2), theta = T - tau

    In steady following s = s0 + T v. With T = 1.5 tau this is Gipps' formula with his choice theta = tau/2.

    Source: Gipps (1981), eq. 3, with the driver's own braking taken as the leader's.
    """
    b, tau = drivers.braking, drivers.reaction_time
    reserve = b * (drivers.time_gap - 0.5 * tau)
    inside = reserve**2 + 2.0 * b * (gap - drivers.jam_gap) - b * tau * speed + leader_speed**2
    return np.maximum(np.sqrt(np.maximum(inside, 0.0)) - reserve, 0.0)


def chosen_acceleration(
    speed: np.ndarray,
    desired_speed: np.ndarray,
    gap: np.ndarray,
    leader_speed: np.ndarray,
    leader_acceleration: np.ndarray,
    drivers: Drivers,
) -> np.ndarray:
    """Acceleration towards the lower of free and safe speed [m/s^2].

    Braking stays comfortable unless a collision is to be avoided. For that the deceleration may reach the leader's
    plus 1.3 (v - vl)^2 / (2 (s - s0/2)), which is 1.3 times the deceleration that just avoids contact. So a driver
    waits until a short but safe gap grows instead of braking hard.
    """
    target = np.minimum(free_speed(speed, desired_speed, drivers), safe_speed(speed, gap, leader_speed, drivers))
    acceleration = (target - speed) / drivers.reaction_time
    room = np.maximum(gap - 0.5 * drivers.jam_gap, 0.2)
    closing = np.maximum(speed - leader_speed, 0.0)
    needed = KINEMATIC_MARGIN * closing**2 / (2.0 * room) + np.maximum(-leader_acceleration, 0.0)
    limit = np.minimum(np.maximum(drivers.comfort_decel, needed), EMERGENCY_DECEL)
    return np.clip(acceleration, -limit, 1.7 * drivers.max_accel)

"""Cause of a difference between highway-env's run of a scene and the core's, from facts at the first tick with one."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from rearl_jax.core.kinematics import HEADING_TIME, LATERAL_TIME
from rearl_jax.validation.comparison import Comparison
from rearl_jax.validation.records import Recorded
from rearl_jax.validation.scenarios import TICKS_PER_SECOND

JUMP_FACTOR = 100.0
"""Growth of a difference within one tick that is a jump: no rounding error of a smooth step grows like that."""

SLOW_TICKS = 30
"""Ticks before the first difference in which slow driving can have caused it: two seconds, in which errors grow
tenfold per tick.
"""


class Cause(Enum):
    """Cause of the difference of two runs."""

    push_tie = "contact: resting-contact tie; two directions of a push are equal but for the last place, one is taken"
    push = "contact: pushes of a collision carry on rounding errors"
    standstill = "near standstill: unstable lateral controller amplifies last-place rounding"
    decision = "decision within rounding of its threshold"
    follows_contact = "follows a vehicle that contact has moved"
    unexplained = "unexplained"


@dataclass(frozen=True)
class Facts:
    """The vehicle that differs first, at the first tick with a difference.

    Attributes:
        tick: This tick.
        vehicle: Index of the vehicle; of several the one that differs most.
        difference: Difference of the vehicle's position [m].
        growth: This difference over that of the tick before [-].
        speed: Speed [m/s].
        slowest: Smallest absolute speed in the two seconds before [m/s].
        unstable_below: Speed below which its lateral controller is unstable [m/s].
        is_crashed: Whether it has crashed.
        has_flipped: Whether its target lanes in the two runs have differed.
        contact_tick: First tick at which a vehicle of the scene has crashed.
    """

    tick: int
    vehicle: int
    difference: float
    growth: float
    speed: float
    slowest: float
    unstable_below: float
    is_crashed: bool
    has_flipped: bool
    contact_tick: int


def measure(comparison: Comparison, recorded: Recorded, scene: int, tick: int, tolerance: float) -> Facts:
    """The facts about one scene of a batch that differs by more than a tolerance [m] from a tick on."""
    position = comparison.position[: tick + 1, :, scene]
    flipped = comparison.flipped[: tick + 1, :, scene]
    marked = flipped[tick] | comparison.crash_differs[tick, :, scene]
    vehicle = int(np.argmax(position[tick])) if (position[tick] > tolerance).any() else int(np.argmax(marked))
    speed = np.abs(recorded.tracks.speed[max(0, tick - SLOW_TICKS) : tick + 1, vehicle, scene])
    difference_before = float(position[tick - 1, vehicle]) if tick else 0.0
    difference_before = max(difference_before, float(np.finfo(np.float64).eps))
    length = float(recorded.start.length[vehicle, scene])
    return Facts(
        tick=tick,
        vehicle=vehicle,
        difference=float(position[tick, vehicle]),
        growth=float(position[tick, vehicle]) / difference_before,
        speed=float(recorded.tracks.speed[tick, vehicle, scene]),
        slowest=float(speed.min()),
        unstable_below=unstable_below(length),
        is_crashed=bool(recorded.tracks.crashed[tick, vehicle, scene]),
        has_flipped=bool(flipped[:, vehicle].any()),
        contact_tick=int(comparison.contact[scene]),
    )


def unstable_below(length: float) -> float:
    """Speed [m/s] below which highway-env's lateral controller is unstable for a vehicle of a length [m].

    A lateral offset y is steered back by the slip angle -(l / 2) y / (v^2 t_h t_l), which moves the vehicle sideways by
    the slip angle times v dt: y is multiplied by 1 - (l / 2) dt / (v t_h t_l) each tick, beyond -1 if v is below
    (l / 2) dt / (2 t_h t_l). 0.69 m/s for 5 m, dt = 1/15 s, t_h = 0.2 s, t_l = 0.6 s.

    Source: highway-env 1.12.1, `ControlledVehicle.steering_control`, linearised.
    """
    return length / 2 / TICKS_PER_SECOND / (2 * HEADING_TIME * LATERAL_TIME)


def name_cause(facts: Facts) -> Cause:
    """The cause that the facts show."""
    if facts.is_crashed:
        return Cause.push_tie if facts.growth > JUMP_FACTOR else Cause.push
    if facts.slowest < facts.unstable_below:
        return Cause.standstill
    if facts.has_flipped:
        return Cause.decision
    return Cause.follows_contact if facts.tick >= facts.contact_tick else Cause.unexplained

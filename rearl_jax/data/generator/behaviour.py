"""Where an effect can act on the generated drivers, and what it gets to see.

A modifier is a picklable callable (a frozen dataclass with `__call__`) that receives a quantity of every
driver on the road and the `Situation`, and returns the changed quantity. Stop-and-go traffic uses the same
places as any effect that is added to normal traffic on purpose.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.data.generator.fleet import Fleet


@dataclass(frozen=True)
class Situation:
    """What the drivers on the road see at one moment; arrays over the vehicles of the fleet.

    Attributes:
        time: Time since the start of the simulation [s].
        fleet: Drivers and their own state.
        leader: Index in the fleet of the vehicle followed, -1 = none.
        gap: Bumper to bumper distance to the leader [m], inf without one.
        leader_speed: Speed of the leader [m/s]; the own speed without one.
        leader_acceleration: Acceleration of the leader [m/s^2]; 0 without one.
    """

    time: float
    fleet: Fleet
    leader: np.ndarray
    gap: np.ndarray
    leader_speed: np.ndarray
    leader_acceleration: np.ndarray


Modifier = Callable[[np.ndarray, Situation], np.ndarray]


@dataclass(frozen=True)
class Behaviour:
    """Modifiers of the driver model, applied in order at each place.

    Attributes:
        perception: Change the situation before any decision.
        desired_speed: Change the desired speed [m/s].
        time_gap: Change the time gap kept while following [s].
        acceleration: Change the acceleration after all limits [m/s^2].
        incentive_left: Change the speed gain expected from a change to the left [m/s].
        incentive_right: Change the speed loss expected from a change to the right [m/s].
    """

    perception: tuple[Callable[[Situation], Situation], ...] = ()
    desired_speed: tuple[Modifier, ...] = ()
    time_gap: tuple[Modifier, ...] = ()
    acceleration: tuple[Modifier, ...] = ()
    incentive_left: tuple[Modifier, ...] = ()
    incentive_right: tuple[Modifier, ...] = ()

    def with_desired_speed(self, modifier: Modifier) -> "Behaviour":
        """The same with a further modifier of the desired speed."""
        return replace(self, desired_speed=(*self.desired_speed, modifier))

    def names(self) -> list[str]:
        """`place: modifier` of everything that is active, for the record of what was planted."""
        return [f"{place}: {modifier!r}" for place, group in vars(self).items() for modifier in group]


def modified(value: np.ndarray, modifiers: tuple[Modifier, ...], situation: Situation) -> np.ndarray:
    """The value after all modifiers."""
    for modifier in modifiers:
        value = modifier(value, situation)
    return value


@dataclass(frozen=True)
class SpeedRestriction:
    """Desired-speed modifier: a bottleneck whose passable speed changes in phases and starts waves.

    Attributes:
        direction: Carriageway it lies on.
        start, end: Stretch of road [m].
        times: Start of each phase [s], rising; before the first there is no restriction.
        speeds: Passable speed in each phase [m/s].
    """

    direction: int
    start: float
    end: float
    times: tuple[float, ...]
    speeds: tuple[float, ...]

    def __call__(self, value: np.ndarray, situation: Situation) -> np.ndarray:
        phase = int(np.searchsorted(self.times, situation.time, side="right")) - 1
        if phase < 0:
            return value
        fleet = situation.fleet
        inside = (fleet.position >= self.start) & (fleet.position <= self.end) & (fleet.direction == self.direction)
        return np.where(inside, np.minimum(value, self.speeds[phase]), value)

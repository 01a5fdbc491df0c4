"""Situation of the generated drivers at one time step, and the bottleneck that causes stop-and-go traffic."""

from dataclasses import dataclass

import numpy as np

from rearl_jax.data.generator.fleet import Fleet


@dataclass(frozen=True)
class Situation:
    """Traffic as the drivers on the road perceive it at one time step; arrays over the vehicles of the fleet.

    Attributes:
        time: Time since the start of the simulation [s].
        fleet: Drivers and their own state.
        gap: Bumper to bumper distance to the leader [m], inf if there is none.
        leader_speed: Speed of the leader [m/s]; the driver's own speed if there is none.
        leader_acceleration: Acceleration of the leader [m/s^2]; 0 if there is none.
    """

    time: float
    fleet: Fleet
    gap: np.ndarray
    leader_speed: np.ndarray
    leader_acceleration: np.ndarray


@dataclass(frozen=True)
class SpeedRestriction:
    """Bottleneck whose passable speed changes in phases, so that stop-and-go waves start there.

    Attributes:
        direction: Carriageway it lies on.
        start, end: Stretch of road [m].
        times: Start of each phase [s], in ascending order; before the first there is no restriction.
        speeds: Passable speed in each phase [m/s].
    """

    direction: int
    start: float
    end: float
    times: tuple[float, ...]
    speeds: tuple[float, ...]

    def limited(self, desired_speed: np.ndarray, situation: Situation) -> np.ndarray:
        """Desired speed of every driver [m/s], at most the passable speed for those in the bottleneck.

        Args:
            desired_speed: Desired speed on a free road [m/s].
            situation: Position of every driver, and the time.
        """
        phase = int(np.searchsorted(self.times, situation.time, side="right")) - 1
        if phase < 0:
            return desired_speed
        fleet = situation.fleet
        inside = (fleet.position >= self.start) & (fleet.position <= self.end) & (fleet.direction == self.direction)
        return np.where(inside, np.minimum(desired_speed, self.speeds[phase]), desired_speed)

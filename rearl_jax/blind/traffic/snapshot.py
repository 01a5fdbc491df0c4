"""Snapshot of the traffic: states of all vehicles, and their neighbours.

Arrays over vehicles have one additional element, a placeholder very far ahead that represents a missing vehicle.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.blind.traffic.fleet import Fleet
from rearl_jax.blind.traffic.models import BASES, Drivers
from rearl_jax.blind.traffic.population import USUAL
from rearl_jax.blind.traffic.scenario import Scenario

FAR = 1.0e7
"""Distance of the placeholder for a missing vehicle [m]."""

BESIDE_REFRESH = 5
"""Sub-steps after which the neighbours on other lanes are looked up again."""


class Snapshot:
    """The state of all vehicles and the neighbours that follow from it.

    Attributes:
        time: Time since the recording began [s]; negative before.
        step: Number of the sub-step.
        position, speed, acceleration, length, is_truck: State of every vehicle, and of the placeholder.
        lane: Lane of every vehicle, 0 = leftmost; without the placeholder, like the attributes below.
        leader, follower: Index of the vehicle ahead and behind on the lane; n if there is none.
        wander: Lateral offset in the lane, positive to the right [m].
        time_gap, desired_speed: Current values of the driver, hidden effects included.
        model: Car-following model of all drivers.
        speed_scale: Median desired speed of cars over the usual one [-].
    """

    def __init__(self, scenario: Scenario, fleet: Fleet, position: np.ndarray, speed: np.ndarray) -> None:
        self.fleet, self.n_lanes, self._shape = fleet, scenario.n_lanes, (scenario.n_recordings, scenario.n_vehicles)
        self.n = len(position)
        self.time, self.step = 0.0, 0
        self.position, self.speed = np.append(position, FAR), np.append(speed, 30.0)
        self.acceleration = np.zeros(self.n + 1)
        self.length, self.is_truck = np.append(fleet.length, 0.0), np.append(fleet.is_truck, False)
        self.lane = fleet.lane.copy()
        self.wander = np.zeros(self.n)
        self.time_gap, self.desired_speed = fleet.time_gap, fleet.desired_speed
        self.model = BASES[scenario.base]
        self.speed_scale = scenario.population.median("desired_speed") / USUAL.median("desired_speed")
        self._beside_step, self._beside = -BESIDE_REFRESH, np.zeros((0, 0))
        self.look_along()

    def drivers(self, who: np.ndarray | None = None) -> Drivers:
        """All drivers, or those with the given indices, as they are; n is the placeholder."""
        if who is None:
            return Drivers(self.speed[: self.n], self.desired_speed, self.time_gap, self.fleet)
        desired_speed, time_gap = (np.append(values, 1.0)[who] for values in (self.desired_speed, self.time_gap))
        return Drivers(self.speed[who], desired_speed, time_gap, self.fleet, who)

    def interaction(self, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """Interaction of every driver with a vehicle ahead, at a gap [m] and an approach rate [m/s]."""
        return self.model.interaction(self.drivers(), gap, dv)

    def look_along(self) -> None:
        """Updates leaders and followers; they only change with lane changes."""
        group = self.fleet.recording * self.n_lanes + self.lane
        order = np.lexsort((self.position[: self.n], group))
        same = group[order[1:]] == group[order[:-1]]
        self.leader, self.follower = np.full(self.n, self.n), np.full(self.n, self.n)
        self.leader[order[:-1][same]] = order[1:][same]
        self.follower[order[1:][same]] = order[:-1][same]
        self._next = np.append(self.leader, self.n)

    def ahead(self, count: int) -> np.ndarray:
        """Index of the `count`-th vehicle ahead on the lane; n if there is none."""
        vehicle = self.leader
        for _ in range(count - 1):
            vehicle = self._next[vehicle]
        return vehicle

    def gap_to(self, other: np.ndarray) -> np.ndarray:
        """Bumper-to-bumper gap to a vehicle ahead [m]; FAR if there is none."""
        n = self.n
        distance = self.position[other] - self.position[:n] - 0.5 * (self.length[other] + self.length[:n])
        return np.where(other == self.n, FAR, distance)

    def gap_behind(self, other: np.ndarray) -> np.ndarray:
        """Bumper-to-bumper gap to a vehicle behind [m]; FAR if there is none."""
        n = self.n
        distance = self.position[:n] - self.position[other] - 0.5 * (self.length[other] + self.length[:n])
        return np.where(other == self.n, FAR, distance)

    def offsets_beside(self) -> np.ndarray:
        """Distance by which each vehicle of the recording is ahead on an adjacent lane [m], [n, n_vehicles].

        Infinite for all others; up to BESIDE_REFRESH sub-steps old.
        """
        if self.step - self._beside_step >= BESIDE_REFRESH:
            position, lane = self.position[: self.n].reshape(self._shape), self.lane.reshape(self._shape)
            offset = position[:, None, :] - position[:, :, None]
            is_beside = np.abs(lane[:, None, :] - lane[:, :, None]) == 1
            self._beside = np.where(is_beside, offset, np.inf).reshape(self.n, -1)
            self._beside_step = self.step
        return self._beside

    def ahead_on_left(self) -> np.ndarray:
        """Index of the next vehicle ahead on the left lane, n if there is none; updated like `offsets_beside`."""
        offsets, lanes = self.offsets_beside(), self.lane.reshape(self._shape)
        is_left = np.repeat(lanes, self._shape[1], axis=0) < self.lane[:, None]
        return self.first_of(np.where(is_left & (offsets >= 0.0), offsets, np.inf))

    def first_of(self, offsets: np.ndarray) -> np.ndarray:
        """Index of the vehicle with the smallest of the given offsets (form of `offsets_beside`); n if all are
        infinite.
        """
        column = np.argmin(offsets, axis=1)
        is_there = np.isfinite(offsets[np.arange(self.n), column])
        return np.where(is_there, self.fleet.recording * self._shape[1] + column, self.n)


@dataclass(frozen=True)
class Choice:
    """The option of a lane change to one side, for every vehicle.

    Attributes:
        side: -1 to the left, +1 to the right.
        leader, rear: New leader and new follower; n if there is none.
        gap: Bumper-to-bumper gap to the new leader [m]; FAR if there is none.
        gain: Gain in the acceleration of the driver who changes [m/s^2].
        cost_to_rear: Loss of the new follower's acceleration [m/s^2], positive.
        follower_gain: Gain of the present follower's acceleration [m/s^2].
        is_possible: Whether the lane exists, the gaps are sufficient, and no driver would have to brake too hard.
    """

    side: int
    leader: np.ndarray
    rear: np.ndarray
    gap: np.ndarray
    gain: np.ndarray
    cost_to_rear: np.ndarray
    follower_gain: np.ndarray
    is_possible: np.ndarray

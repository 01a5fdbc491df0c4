"""Measured drivers: their motion and surroundings, in arrays for the observer (Kalman filter of the driver model).

A piece is an uninterrupted part of a track; a long track is cut into several pieces, which share one driver. The motion
of all vehicles around a driver is taken as measured, so drivers are independent of each other.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from rearl_jax.discovery.read.fused_errors import FusedErrors
from rearl_jax.discovery.read.kernels import UNSMOOTHED, Kernel

# Quantities that jump when another vehicle becomes the leader, the second leader, or one of the other vehicles.
_OF_LEADER = (
    "leader_rear",
    "leader_centre",
    "leader_speed",
    "leader_acceleration",
    "time_since_change",
    "time_to_next",
)
_OF_SECOND = ("second_rear", "second_speed", "third_speed")
_OF_OTHERS = (
    "follower_front",
    "follower_speed",
    "left_rear",
    "left_speed",
    "next_rear",
    "next_speed",
    "former_rear",
    "former_speed",
)

_SPEED_OF = {  # the speed with which a position changes
    "leader_rear": "leader_speed",
    "leader_centre": "leader_speed",
    "second_rear": "second_speed",
    "follower_front": "follower_speed",
    "left_rear": "left_speed",
    "next_rear": "next_speed",
    "former_rear": "former_speed",
}

_LEAST_JUMP = 6.0
"""Change within a time step from which another vehicle is assumed: of a speed [m/s], or of a position minus speed times
time [m].
"""


class Surroundings(eqx.Module):
    """Measured surroundings of drivers, `[n_steps, n_pieces]`.

    Attributes:
        time: Time since the start of the recording [s].
        lane, is_leftmost, is_rightmost, lateral_offset: As in `core.effects.stimulus.Stimulus`.
        has_leader: Whether there is a leader.
        leader_rear: Rear bumper of the leader [m].
        leader_centre: Centre of the leader [m].
        leader_speed: Speed of the leader [m/s].
        leader_acceleration: Acceleration of the leader [m/s^2].
        leader_length: Length of the leader [m].
        leader_is_truck: Whether the leader is a truck.
        has_second, second_rear, second_speed: The leader's leader; its rear bumper minus the length of the leader.
        has_third, third_speed: The third vehicle ahead.
        has_follower, follower_front, follower_speed: The vehicle behind, its front bumper [m] and speed [m/s].
        has_left, left_rear, left_speed: The next vehicle ahead on the lane to the left, its rear bumper and speed.
        beside_speed, n_beside: As in `Stimulus`.
        time_since_change, gap_lost, time_gap_at_change: As in `Stimulus`.
        time_to_next, next_rear, next_speed, next_by_own, next_is_nearer: The next leader, as in `RecordedStimulus`.
        former_rear, former_speed: The leader before the last change.
    """

    time: Float[Any, "*steps pieces"]
    lane: Float[Any, "*steps pieces"]
    is_leftmost: Float[Any, "*steps pieces"]
    is_rightmost: Float[Any, "*steps pieces"]
    lateral_offset: Float[Any, "*steps pieces"]
    has_leader: Float[Any, "*steps pieces"]
    leader_rear: Float[Any, "*steps pieces"]
    leader_centre: Float[Any, "*steps pieces"]
    leader_speed: Float[Any, "*steps pieces"]
    leader_acceleration: Float[Any, "*steps pieces"]
    leader_length: Float[Any, "*steps pieces"]
    leader_is_truck: Float[Any, "*steps pieces"]
    has_second: Float[Any, "*steps pieces"]
    second_rear: Float[Any, "*steps pieces"]
    second_speed: Float[Any, "*steps pieces"]
    has_third: Float[Any, "*steps pieces"]
    third_speed: Float[Any, "*steps pieces"]
    has_follower: Float[Any, "*steps pieces"]
    follower_front: Float[Any, "*steps pieces"]
    follower_speed: Float[Any, "*steps pieces"]
    has_left: Float[Any, "*steps pieces"]
    left_rear: Float[Any, "*steps pieces"]
    left_speed: Float[Any, "*steps pieces"]
    beside_speed: Float[Any, "*steps pieces"]
    n_beside: Float[Any, "*steps pieces"]
    time_since_change: Float[Any, "*steps pieces"]
    gap_lost: Float[Any, "*steps pieces"]
    time_gap_at_change: Float[Any, "*steps pieces"]
    time_to_next: Float[Any, "*steps pieces"]
    next_rear: Float[Any, "*steps pieces"]
    next_speed: Float[Any, "*steps pieces"]
    next_by_own: Float[Any, "*steps pieces"]
    next_is_nearer: Float[Any, "*steps pieces"]
    former_rear: Float[Any, "*steps pieces"]
    former_speed: Float[Any, "*steps pieces"]


def is_new(steps: int, stride: int) -> Bool[np.ndarray, " steps"]:
    """True for every `stride`-th time step, those with an independent measurement."""
    return np.arange(steps) % stride == 0


@dataclass(frozen=True)
class Measured:
    """Pieces of measured drives with their drivers.

    Attributes:
        y: Measured position of the driver's vehicle, its centre [m].
        weight: 1 if the time step counts, 0 if it is excluded or padding.
        smooth, smooth_speed: Smoothed position [m] and speed [m/s] of the driver's vehicle.
        surroundings: Surrounding vehicles, and the time, in every time step.
        length: Length of the driver's vehicle [m].
        is_truck: Whether the driver's vehicle is a truck.
        driver: Index of the driver of each piece, 0 to n_drivers - 1.
        vehicle: Track of each piece, unique over all recordings.
        leader: Track of the leader in every time step, -1 if there is none.
        recording: Index of the recording of each piece.
        identity: Number of the person or car of each piece, the same in all tracks and recordings; -1 if unknown.
        dt: Time step [s].
        stride: Time steps from one independent measurement to the next; those between do not count.
        noise: Standard deviation of the measured positions [m].
        kernel: Kernel that positions were smoothed with before they were released.
        jumps: Number of jumps of positions in the recordings; samples around them are excluded.
        fused_errors: Errors of the positions of all vehicles, if they were fused with speeds; None if not.
        labels: Labels of each piece, equal for all pieces of a driver: texts, None where unknown.
    """

    y: Float[np.ndarray, "steps pieces"]
    weight: Float[np.ndarray, "steps pieces"]
    smooth: Float[np.ndarray, "steps pieces"]
    smooth_speed: Float[np.ndarray, "steps pieces"]
    surroundings: Surroundings
    length: Float[np.ndarray, " pieces"]
    is_truck: Bool[np.ndarray, " pieces"]
    driver: Int[np.ndarray, " pieces"]
    vehicle: Int[np.ndarray, " pieces"]
    leader: Int[np.ndarray, "*steps pieces"]
    recording: Int[np.ndarray, " pieces"]
    identity: Int[np.ndarray, " pieces"]
    dt: float
    stride: int
    noise: float
    kernel: Kernel = UNSMOOTHED
    jumps: int = 0
    fused_errors: FusedErrors | None = None
    labels: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def gap(self) -> Float[np.ndarray, "steps pieces"]:
        """Measured bumper-to-bumper gap to the leader, by smoothed positions [m]."""
        return self.surroundings.leader_rear - (self.smooth + self.length / 2)

    @property
    def n_drivers(self) -> int:
        """Number of drivers."""
        return int(self.driver.max()) + 1 if len(self.driver) else 0

    @property
    def seconds(self) -> float:
        """Driver-seconds that count [s]; each counting time step lasts to the next independent measurement."""
        return float(np.sum(self.weight) * self.dt * self.stride)

    @property
    def driver_minutes(self) -> Float[np.ndarray, " drivers"]:
        """Time of each driver that counts [min]."""
        seconds = self.weight.sum(axis=0) * self.dt * self.stride
        return np.bincount(self.driver, seconds, self.n_drivers) / 60

    @property
    def identity_of_driver(self) -> Int[np.ndarray, " drivers"]:
        """Number of the person or car of each driver, see `identity`; -1 if unknown."""
        return self.driver_values(self.identity)

    def label(self, name: str) -> np.ndarray:
        """A label of each driver: texts, None where unknown."""
        return self.driver_values(self.labels[name])

    def of_drivers(self, is_kept: Bool[np.ndarray, " drivers"]) -> "Measured":
        """The selected drivers, renumbered in their order."""
        return self.select(np.flatnonzero(is_kept[self.driver]))

    def sample(self, most: int, seed: int, group: Int[np.ndarray, " drivers"] | None = None) -> "Measured":
        """A random sample of at most `most` drivers of each group; without groups, of all drivers."""
        group = np.zeros(self.n_drivers, int) if group is None else group
        rng, is_kept = np.random.default_rng(seed), np.zeros(self.n_drivers, bool)
        for number in np.unique(group):
            members = np.flatnonzero(group == number)
            if len(members) > most:
                members = members[rng.choice(len(members), most, replace=False)]
            is_kept[members] = True
        return self if is_kept.all() else self.of_drivers(is_kept)

    def is_corrected(self) -> Float[np.ndarray, " steps"]:
        """1 for time steps with an independent measurement, which corrects the observer, else 0."""
        return is_new(len(self.y), self.stride).astype(float)

    def driver_values(self, values: Shaped[np.ndarray, " pieces"]) -> Shaped[np.ndarray, " drivers"]:
        """The value of each driver, from values that are equal for all its pieces."""
        of_driver = np.empty(self.n_drivers, values.dtype)
        of_driver[self.driver] = values
        return of_driver

    def driver_mean(self, values: Float[np.ndarray, "steps pieces"]) -> Float[np.ndarray, " drivers"]:
        """Mean over the time steps of each driver that count."""
        total, count = (
            np.bincount(self.driver, part.sum(axis=0), self.n_drivers) for part in (values * self.weight, self.weight)
        )
        return total / np.maximum(count, 1.0)

    def halfway(self) -> Surroundings:
        """Surroundings halfway between each time step and the next, by interpolation; where a value jumps because
        another vehicle takes the place, the value of the former time step.
        """
        surroundings = self.surroundings
        no_step_after_last = np.zeros_like(self.y[:1])
        same_leader = self.leader[1:] == self.leader[:-1]
        same_second = same_leader & (surroundings.has_second[1:] == surroundings.has_second[:-1])

        def middle(name: str) -> np.ndarray:
            values = getattr(surroundings, name)
            step = values[1:] - values[:-1]
            unexplained, half = step, step / 2
            if name in _SPEED_OF:
                speed = getattr(surroundings, _SPEED_OF[name])
                unexplained = step - (speed[1:] + speed[:-1]) * (self.dt / 2)
                half = half - (speed[1:] - speed[:-1]) * (self.dt / 8)  # assumes constant acceleration
            is_same = same_leader if name in _OF_LEADER else np.abs(unexplained) < _LEAST_JUMP
            if name in _OF_SECOND:
                is_same = is_same & same_second
            return values + np.concatenate([np.where(is_same, half, 0.0), no_step_after_last])

        interpolated = {name: middle(name) for name in (*_OF_LEADER, *_OF_SECOND, *_OF_OTHERS)}
        return dataclasses.replace(surroundings, **interpolated)

    def select(self, pieces: np.ndarray) -> "Measured":
        """The selected pieces; drivers are renumbered in their order."""
        return dataclasses.replace(
            self,
            surroundings=jax.tree.map(lambda values: values[:, pieces], self.surroundings),
            driver=np.unique(self.driver[pieces], return_inverse=True)[1],
            labels={name: values[pieces] for name, values in self.labels.items()},
            **{name: getattr(self, name)[..., pieces] for name in BY_PIECE},
        )

    def with_drivers(self, other: "Measured") -> "Measured":
        """These drivers and then those of `other`, from the same recordings, with consecutive driver numbers."""
        renumbered = dataclasses.replace(other, driver=self.n_drivers + other.driver)
        return dataclasses.replace(self, **joined([self, renumbered]))


BY_PIECE = ("y", "weight", "smooth", "smooth_speed", "length", "is_truck", "vehicle", "leader", "recording", "identity")
"""Arrays of `Measured` whose last axis is the pieces, except `driver`, which is renumbered in a selection."""


def joined(parts: Sequence[Measured]) -> dict[str, Any]:
    """Concatenated arrays of several parts, by the names of `Measured`; drivers keep their numbers."""
    surroundings = jax.tree.map(lambda *values: np.concatenate(values, axis=-1), *(part.surroundings for part in parts))
    arrays = {name: np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in (*BY_PIECE, "driver")}
    labels = {name: np.concatenate([part.labels[name] for part in parts]) for name in parts[0].labels}
    return arrays | {"surroundings": surroundings, "labels": labels}

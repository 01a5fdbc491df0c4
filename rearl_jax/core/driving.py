"""Interface between driver models and the vehicle: accelerations and target lanes of one time step."""

from collections.abc import Callable
from typing import NamedTuple

from jaxtyping import Array, Float, Int

from rearl_jax.core.state import TrafficState


class Driving(NamedTuple):
    """Output of a driver model in one time step.

    Attributes:
        state: The traffic, with the drivers' memory after this time step.
        own_acceleration: Acceleration on the lane that each vehicle is on [m/s^2].
        target_lane: Lane each driver wants to be on.
        acceleration_on: Function from another lane of each vehicle to the acceleration there [m/s^2]; undefined for the
            lane that the vehicle is on.
    """

    state: TrafficState
    own_acceleration: Float[Array, "vehicles *scenarios"]
    target_lane: Int[Array, "vehicles *scenarios"]
    acceleration_on: Callable[[Int[Array, "vehicles *scenarios"]], Float[Array, "vehicles *scenarios"]]

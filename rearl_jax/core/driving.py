"""Interface between driver models and the vehicle: accelerations and target lanes of one time step."""

from collections.abc import Callable
from typing import NamedTuple

from jaxtyping import Array, Float, Int

from rearl_jax.core.state import TrafficState


class Driving(NamedTuple):
    """Output of a driver model in one time step.

    Attributes:
        state: The traffic, with the drivers' memory after this time step.
        own_acceleration: Acceleration on the own lane [m/s^2].
        target_lane: Lane each driver wants to be on.
        on_lane: Function from lanes to the accelerations there [m/s^2]; undefined for the own lane.
    """

    state: TrafficState
    own_acceleration: Float[Array, "vehicles *scenarios"]
    target_lane: Int[Array, "vehicles *scenarios"]
    on_lane: Callable[[Int[Array, "vehicles *scenarios"]], Float[Array, "vehicles *scenarios"]]

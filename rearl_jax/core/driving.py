"""What drivers make of a time step, whichever rules they drive by."""

from collections.abc import Callable
from typing import NamedTuple

from jaxtyping import Array, Float, Int

from rearl_jax.core.state import TrafficState


class Driving(NamedTuple):
    """What drivers want in a time step.

    Attributes:
        state: The traffic, with what drivers now remember.
        own: Acceleration on the own lane [m/s^2].
        target_lane: Lane each driver wants to be on.
        on_lane: From lanes to the accelerations there [m/s^2]; what it says of the own lane means nothing.
    """

    state: TrafficState
    own: Float[Array, "vehicles *scenarios"]
    target_lane: Int[Array, "vehicles *scenarios"]
    on_lane: Callable[[Int[Array, "vehicles *scenarios"]], Float[Array, "vehicles *scenarios"]]

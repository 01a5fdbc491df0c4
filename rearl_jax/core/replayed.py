"""Replayed vehicles: they move as they were recorded; all drivers see them, and they react to none."""

import equinox as eqx
from jaxtyping import Array, Float, Int

NOT_RECORDED = -1_000
"""Lane of a slot that contains no vehicle at the moment; no search finds it."""


class ReplayedVehicles(eqx.Module):
    """Recorded vehicles around the simulated ones at one moment; each slot of the arrays contains one or none.

    Attributes:
        x: Position of the centre along the road [m].
        speed: Speed along the road [m/s].
        acceleration: Acceleration along the road [m/s^2].
        lane: Lane; NOT_RECORDED where the slot contains no vehicle.
        length: Length [m].
        is_truck: 1 for a truck, else 0.
        number: Number of the vehicle, constant while it is replayed; larger than any index of a simulated vehicle.
    """

    x: Float[Array, "replayed *scenarios"]
    speed: Float[Array, "replayed *scenarios"]
    acceleration: Float[Array, "replayed *scenarios"]
    lane: Int[Array, "replayed *scenarios"]
    length: Float[Array, "replayed *scenarios"]
    is_truck: Float[Array, "replayed *scenarios"]
    number: Int[Array, "replayed *scenarios"]

    @property
    def n_slots(self) -> int:
        """Number of slots for vehicles in a scenario."""
        return self.x.shape[0]

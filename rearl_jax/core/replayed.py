"""Vehicles that drive as they were recorded: seen by all drivers, reacting to none."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

NOT_RECORDED = -1_000
"""Lane of a place that holds no vehicle at that moment; no vehicle searches it."""


class ReplayedVehicles(eqx.Module):
    """Recorded vehicles around the simulated ones at one moment; each place holds one of them or none.

    Attributes:
        x: Position of the centre along the road [m].
        speed: Along the road [m/s].
        acceleration: Along the road [m/s^2].
        lane: Lane; NOT_RECORDED where the place holds no vehicle.
        length: Length [m].
        is_truck: 1 for a truck, else 0.
        number: Number of the vehicle, the same for as long as it is replayed, above those of all simulated vehicles.
    """

    x: Float[Array, "replayed *scenarios"]
    speed: Float[Array, "replayed *scenarios"]
    acceleration: Float[Array, "replayed *scenarios"]
    lane: Int[Array, "replayed *scenarios"]
    length: Float[Array, "replayed *scenarios"]
    is_truck: Float[Array, "replayed *scenarios"]
    number: Int[Array, "replayed *scenarios"]

    @property
    def n_places(self) -> int:
        """Places for vehicles in a scenario."""
        return self.x.shape[0]


class Nearest(NamedTuple):
    """The nearest replayed vehicle of each simulated one in some direction.

    Attributes:
        distance: Centre to centre [m]; inf for none.
        speed: Its speed [m/s]; 0 for none.
    """

    distance: Float[Array, "*n"]
    speed: Float[Array, "*n"]


class ReplayedBeside(eqx.Module):
    """The nearest replayed vehicles on the lanes beside simulated ones.

    Attributes:
        lane: Own lane of each.
        ahead: On the left and on the right lane.
        behind: On both, which a vehicle side by side is not.
    """

    lane: Int[Array, "vehicles *scenarios"]
    ahead: tuple[Nearest, Nearest]
    behind: tuple[Nearest, Nearest]

    def ahead_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Nearest:
        """The nearest ahead on a lane beside that is given for each."""
        return self._on(lane, self.ahead)

    def behind_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Nearest:
        """The nearest behind on a lane beside that is given for each."""
        return self._on(lane, self.behind)

    def _on(self, lane: Array, sides: tuple[Nearest, Nearest]) -> Nearest:
        left, right = sides
        return Nearest(*(jnp.where(lane < self.lane, *both) for both in zip(left, right, strict=True)))

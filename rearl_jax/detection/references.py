"""Representative scenes: simulated traffic is compared with them, and decisions imitate them."""

import equinox as eqx
from jaxtyping import Array, Float, Int


class References(eqx.Module):
    """Snapshots of the representative scenes, once per second.

    Attributes:
        speed: Rescaled speed of each vehicle [m/s].
        spacing: Mean distance of each vehicle to the others of the snapshot [m].
        mean_spacing: Mean distance over all pairs of the snapshot [m].
        action: Action of each vehicle in the second that follows: 0 left, 1 keep, 2 right, 3 faster, 4 slower.
        share: Share of the scenes that each reference represents [-]; sums to 1.
    """

    speed: Float[Array, "references seconds slots"]
    spacing: Float[Array, "references seconds slots"]
    mean_spacing: Float[Array, "references seconds"]
    action: Int[Array, "references seconds slots"]
    share: Float[Array, " references"]

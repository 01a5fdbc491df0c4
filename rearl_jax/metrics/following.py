"""Leader-follower pairs among the vehicles of a scene."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.metrics.measure import fold_vehicles


class Followers(eqx.Module):
    """Each vehicle as the follower of its leader. Without a leader both distances are inf and the approach rate is 0.

    Attributes:
        has_leader: Whether there is a leader.
        centre_distance: Distance to the leader, centre to centre [m].
        gap: Distance to the leader, bumper to bumper [m].
        dv: Approach rate, the follower's minus the leader's speed [m/s].
        leader_crashed: Whether the leader has crashed.
    """

    has_leader: Bool[Array, "steps vehicles *scenarios"]
    centre_distance: Float[Array, "steps vehicles *scenarios"]
    gap: Float[Array, "steps vehicles *scenarios"]
    dv: Float[Array, "steps vehicles *scenarios"]
    leader_crashed: Bool[Array, "steps vehicles *scenarios"]


def find_leaders(
    position: Float[Array, "steps vehicles *scenarios"],
    speed: Float[Array, "steps vehicles *scenarios"],
    lane: Int[Array, "steps vehicles *scenarios"],
    length: Float[Array, "steps vehicles *scenarios"],
    crashed: Bool[Array, "steps vehicles *scenarios"],
    direction: Int[Array, "steps vehicles *scenarios"] | None = None,
) -> Followers:
    """Distance, approach rate and state of each vehicle's leader.

    The leader is the nearest vehicle ahead in the same lane, and on the same carriageway if `direction` is given, at
    any distance. Vehicles at exactly the same position are not ahead of each other.

    Args:
        position: Centre along the driving direction, growing while driving [m].
        speed: Speed along the driving direction [m/s].
        lane: Lane index.
        length: Vehicle length [m]; the gap is the centre distance less half of both lengths.
        crashed: Whether the vehicle has crashed; crashed vehicles lead like others.
        direction: Carriageway; None if there is only one.

    Source: REARL (Bi et al.), time headway over leader-follower pairs; the paper names no distance limit.
    """

    def nearer_of(best, slot, pick):
        distance = pick(position) - position
        nearer = (pick(lane) == lane) & (distance > 0) & (distance < best[0])
        if direction is not None:
            nearer = nearer & (pick(direction) == direction)
        candidate = (distance, pick(speed), pick(length), pick(crashed))
        return tuple(jnp.where(nearer, new, old) for new, old in zip(candidate, best, strict=True))

    no_vehicle = (jnp.full_like(position, jnp.inf), speed, length, jnp.zeros_like(crashed))
    distance, leader_speed, leader_length, leader_crashed = fold_vehicles(nearer_of, no_vehicle, position.shape[1])
    gap = distance - (length + leader_length) / 2
    return Followers(jnp.isfinite(distance), distance, gap, speed - leader_speed, leader_crashed)

"""Intentions to change lanes, known in simulations only."""

from jaxtyping import Array, Float

from rearl_jax.core.effects.stimulus import Stimulus


class SimulatedStimulus(Stimulus):
    """Stimulus in simulated traffic, with the lane changes that drivers intend.

    Recordings contain lane changes, but not intentions.

    Attributes:
        has_entrant: Whether a vehicle ahead on an adjacent lane is changing to the driver's lane, or would if there
            were room.
        entrant_gap: Bumper-to-bumper gap to the nearest of these vehicles [m]; OUT_OF_SIGHT if there is none.
        entrant_speed: Speed of that vehicle [m/s]; the driver's speed without one.
        has_changer, changer_gap, changer_speed: The same, only for vehicles whose lane change is in progress.
        has_new_leader, new_leader_gap, new_leader_speed: The same for the next vehicle ahead on the lane that the
            driver itself is changing to, or would change to if there were room.
    """

    has_entrant: Float[Array, "*#n"]
    entrant_gap: Float[Array, "*#n"]
    entrant_speed: Float[Array, "*#n"]
    has_changer: Float[Array, "*#n"]
    changer_gap: Float[Array, "*#n"]
    changer_speed: Float[Array, "*#n"]
    has_new_leader: Float[Array, "*#n"]
    new_leader_gap: Float[Array, "*#n"]
    new_leader_speed: Float[Array, "*#n"]


def require_intentions(seen: Stimulus, effect: str) -> SimulatedStimulus:
    """The stimulus of an effect that needs intentions, given its name.

    Raises:
        ValueError: The stimulus is that of a recording.
    """
    if not isinstance(seen, SimulatedStimulus):
        raise ValueError(
            f"{effect} needs to know which vehicles want to change lanes: known in a simulation, not in a recording"
        )
    return seen

"""Intentions to change lanes, which exist only in simulations."""

from jaxtyping import Array, Float

from rearl_jax.core.effects.stimulus import Stimulus


class SimulatedStimulus(Stimulus):
    """Stimulus in simulated traffic, with vehicles ahead that want to change to the own lane.

    Recordings contain lane changes, but not intentions.

    Attributes:
        has_entrant: Whether a vehicle ahead on an adjacent lane is changing to the own lane, or would if there were
            room.
        entrant_gap: Bumper-to-bumper gap to the nearest of these vehicles [m]; OUT_OF_SIGHT without one.
        entrant_speed: Speed of that vehicle [m/s]; the own speed without one.
        has_changer, changer_gap, changer_speed: The same for vehicles whose lane change is in progress.
        has_wanted, wanted_gap, wanted_speed: The same for the next vehicle ahead on the lane that the driver itself is
            changing to, or would change to if there were room.
    """

    has_entrant: Float[Array, "*#n"]
    entrant_gap: Float[Array, "*#n"]
    entrant_speed: Float[Array, "*#n"]
    has_changer: Float[Array, "*#n"]
    changer_gap: Float[Array, "*#n"]
    changer_speed: Float[Array, "*#n"]
    has_wanted: Float[Array, "*#n"]
    wanted_gap: Float[Array, "*#n"]
    wanted_speed: Float[Array, "*#n"]

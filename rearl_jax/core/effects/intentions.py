"""Intentions to change lanes, which only a simulation knows."""

from jaxtyping import Array, Float

from rearl_jax.core.effects.stimulus import Stimulus


class SimulatedStimulus(Stimulus):
    """Stimulus in simulated traffic, with the vehicles ahead that want to come to the own lane.

    Recordings do not contain them: they show lane changes, not wishes.

    Attributes:
        has_entrant: Whether a vehicle ahead on a lane beside is changing to the own lane, or would if there were room.
        entrant_gap: To the nearest of them, bumper to bumper [m]; OUT_OF_SIGHT without one.
        entrant_speed: Its speed [m/s]; the own without one.
        has_changer, changer_gap, changer_speed: The same of vehicles that are already changing, not only wishing to.
        has_wanted, wanted_gap, wanted_speed: The next vehicle ahead on the lane that the driver itself is changing to,
            or would if there were room.
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

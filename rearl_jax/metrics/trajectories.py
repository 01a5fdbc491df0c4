"""Input of the metrics: the vehicles of one scene, and the recorded scene that it is compared with."""

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int


class Trajectories(eqx.Module):
    """Vehicles of a scene, as needed for the metrics; a slot is an index of the vehicle axis.

    Attributes:
        x, y: Centre in the ground frame [m], both carriageways in the same frame.
        position: Centre along the vehicle's driving direction [m]; x in a simulation.
        speed: Speed [m/s].
        scaled_speed: Speed rescaled to the simulator's range; equal to `speed` in a simulation.
        lane: Lane index within the carriageway.
        crashed: Whether the vehicle has crashed; false in recordings.
        length, width: Size of the vehicle [m].
        direction: Carriageway; None if there is only one.
        track_id: Id of the vehicle in each slot; None if it never changes.
        n_crashed_replaced: Crashed vehicles in the slot replaced by entering ones so far [count]; None if none enters.
    """

    x: Float[Array, "steps vehicles *scenarios"]
    y: Float[Array, "steps vehicles *scenarios"]
    position: Float[Array, "steps vehicles *scenarios"]
    speed: Float[Array, "steps vehicles *scenarios"]
    scaled_speed: Float[Array, "steps vehicles *scenarios"]
    lane: Int[Array, "steps vehicles *scenarios"]
    crashed: Bool[Array, "steps vehicles *scenarios"]
    length: Float[Array, "steps vehicles *scenarios"]
    width: Float[Array, "steps vehicles *scenarios"]
    direction: Int[Array, "steps vehicles *scenarios"] | None = None
    track_id: Int[Array, "steps vehicles *scenarios"] | None = None
    n_crashed_replaced: Int[Array, "steps vehicles *scenarios"] | None = None


class SceneReference(eqx.Module):
    """Reference for a simulated scene: speed histogram and spacings [m] of a recorded scene."""

    cumulative_counts: Int[Array, "rows bins *scenarios"]
    mean_spacing: Float[Array, " steps *scenarios"]
    vehicle_spacing: Float[Array, "steps vehicles *scenarios"]

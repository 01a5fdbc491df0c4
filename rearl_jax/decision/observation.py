"""Kinematic observation of the traffic: the observer and the nearest others, a row of numbers for each.

Source: highway-env 1.12.1, `KinematicObservation` with order="sorted".
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.kinematics import MAX_SPEED
from rearl_jax.core.neighbours import for_each_replayed, for_each_vehicle, row
from rearl_jax.core.replayed import NOT_RECORDED, ReplayedVehicles
from rearl_jax.core.state import Controller, TrafficState

COLUMNS = ("presence", "x", "y", "vx", "vy")
"""Columns of each vehicle. Source: highway-env 1.12.1, `KinematicObservation.FEATURES`."""

N_ROWS = 5
"""Vehicles in an observation, the observer first. Source: highway-env 1.12.1, `KinematicObservation`."""

PERCEPTION_DISTANCE = 200.0
"""Distance [m] within which others are observed. Source: highway-env 1.12.1, `AbstractEnv.PERCEPTION_DISTANCE`."""

LANE_WIDTH = 4.0
"""Lane width [m] that the ranges assume. Source: highway-env 1.12.1, `AbstractLane.DEFAULT_WIDTH`."""

REAR_DISTANCE = 10.0
"""Distance behind [m] up to which vehicles are observed without `see_behind`. Source: highway-env 1.12.1,
`Road.close_objects_to`: twice the length of a vehicle.
"""


@dataclass(frozen=True)
class ObservationSpec:
    """Layout and ranges of an observation.

    Attributes:
        ranges: Values of x, y, vx and vy that are scaled to 1 [m, m, m/s, m/s]; larger values are clipped.
        n_rows: Vehicles in an observation, the observer first; missing ones are rows of zeros.
        see_behind: Whether vehicles further back than `REAR_DISTANCE` are seen.
        has_own_x: Whether the observer's own row contains its x, measured from the start of the road, instead of 0.
    """

    ranges: tuple[float, float, float, float]
    n_rows: int = N_ROWS
    see_behind: bool = False
    has_own_x: bool = True

    @property
    def n_features(self) -> int:
        """Numbers in an observation."""
        return self.n_rows * len(COLUMNS)


def highway_env_observation(n_lanes: int, n_rows: int = N_ROWS, *, see_behind: bool = False) -> ObservationSpec:
    """The observation of highway-env's `Kinematics` on a road.

    Source: highway-env 1.12.1, `KinematicObservation.normalize_obs`.
    """
    return ObservationSpec((5 * MAX_SPEED, n_lanes * LANE_WIDTH, 2 * MAX_SPEED, 2 * MAX_SPEED), n_rows, see_behind)


class _ObservedVehicle(eqx.Module):
    """One vehicle, as every observer sees it: distance along the road, position and speed.

    The distance is inf if there is no vehicle.
    """

    distance: Float[Array, "observers scenarios"]
    x: Float[Array, "observers scenarios"]
    y: Float[Array, "observers scenarios"]
    vx: Float[Array, "observers scenarios"]
    vy: Float[Array, "observers scenarios"]

    def columns(self, spec: ObservationSpec) -> list[Float[Array, "observers scenarios"]]:
        """A row of the observation, in the order of `COLUMNS`; all zero if there is no vehicle."""
        presence = jnp.isfinite(self.distance)
        values = (self.x, self.y, self.vx, self.vy)
        scaled = [jnp.clip(value / reach, -1.0, 1.0) for value, reach in zip(values, spec.ranges, strict=True)]
        return [presence.astype(self.x.dtype), *(jnp.where(presence, value, 0.0) for value in scaled)]


def observe_neighbours(
    state: TrafficState,
    spec: ObservationSpec,
    observers: slice = slice(None),
    replayed: ReplayedVehicles | None = None,
) -> Float[Array, "features observers scenarios"]:
    """Observations, float32: `spec.n_rows` rows of `COLUMNS`, one after the other.

    The first row is the observer's own: presence 1, absolute position and speeds. The other rows are those of the
    vehicles nearest along the road, on any lane, crashed or not, the nearest first, relative to the observer.

    Args:
        state: The traffic.
        spec: Layout and ranges.
        observers: Vehicles that observe; by default all.
        replayed: Recorded vehicles around the traffic, on lanes of `LANE_WIDTH`; seen like all others.
    """
    is_there = state.controller != Controller.ABSENT
    vx, vy = state.speed * cosine(state.heading), state.speed * sine(state.heading)
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)[observers]
    own_x, own_y, own_vx, own_vy = (values[observers] for values in (state.x, state.y, vx, vy))

    def insert(
        position: tuple[Array, Array],
        speed: tuple[Array, Array],
        is_other: Array,
        nearest: tuple[_ObservedVehicle, ...],
    ) -> tuple[_ObservedVehicle, ...]:
        """The nearest vehicles, nearest first, after one more vehicle was compared with them."""
        x, y = position[0] - own_x, position[1] - own_y
        is_seen = is_other & (x * x + y * y < PERCEPTION_DISTANCE**2)
        if not spec.see_behind:
            is_seen = is_seen & (x > -REAR_DISTANCE)
        distance = jnp.where(is_seen, jnp.abs(x), jnp.inf)
        candidate = _ObservedVehicle(distance, x, y, speed[0] - own_vx, speed[1] - own_vy)
        ranked = []
        for known in nearest:
            is_nearer = candidate.distance < known.distance
            ranked.append(_where(is_nearer, candidate, known))
            candidate = _where(is_nearer, known, candidate)
        return tuple(ranked)

    def insert_simulated(other: Int[Array, ""], nearest: tuple[_ObservedVehicle, ...]) -> tuple[_ObservedVehicle, ...]:
        position, speed = (row(state.x, other), row(state.y, other)), (row(vx, other), row(vy, other))
        return insert(position, speed, row(is_there, other) & (index != other), nearest)

    zeros = jnp.zeros_like(own_x)
    no_vehicle = _ObservedVehicle(jnp.full_like(own_x, jnp.inf), zeros, zeros, zeros, zeros)
    others = for_each_vehicle(state.x.shape[0], insert_simulated, (no_vehicle,) * (spec.n_rows - 1))
    if replayed is not None:

        def insert_replayed(
            other: Int[Array, ""], nearest: tuple[_ObservedVehicle, ...]
        ) -> tuple[_ObservedVehicle, ...]:
            lane, speed = row(replayed.lane, other), row(replayed.speed, other)
            position = row(replayed.x, other), lane.astype(state.y.dtype) * LANE_WIDTH
            return insert(position, (speed, jnp.zeros_like(speed)), lane != NOT_RECORDED, nearest)

        others = for_each_replayed(replayed.n_slots, insert_replayed, others)
    own = _ObservedVehicle(zeros, own_x if spec.has_own_x else zeros, own_y, own_vx, own_vy)
    return jnp.stack([column for vehicle in (own, *others) for column in vehicle.columns(spec)]).astype(jnp.float32)


def _where(
    condition: Bool[Array, "observers scenarios"], first: _ObservedVehicle, second: _ObservedVehicle
) -> _ObservedVehicle:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), first, second)

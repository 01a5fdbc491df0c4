"""Recorded traffic around episodes that begin with measured scenes: one case per scene and controlled vehicle.

Replayed vehicles do not react. All vehicles react to them, and the controlled vehicle crashes if it touches one.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from rearl_jax.core.boundary import Boundary, BoundarySecond, Entrants, Identity, Motion, replayed_vehicles
from rearl_jax.core.drivers import Body
from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rectangles import Rectangle, separate
from rearl_jax.core.replayed import NOT_RECORDED, ReplayedVehicles
from rearl_jax.core.state import TrafficState


class Surroundings(eqx.Module):
    """Recorded traffic around the vehicles of all cases, as in `core.boundary.Boundary`, the first axis over cases.

    Attributes:
        motion: Replayed vehicles at the beginning of each step of each second, `[cases, seconds, steps, replayed]`.
        identity: Identity of the replayed vehicles, `[cases, seconds, replayed]`.
        entrants: Vehicles that enter at the end of each second, `[cases, seconds, vehicles]`.
    """

    motion: Motion
    identity: Identity
    entrants: Entrants

    @property
    def n_seconds(self) -> int:
        """Seconds after the start that were recorded [s]."""
        return self.motion.x.shape[1] - 1

    def at_start(self, case: Int[Array, "*scenarios"]) -> ReplayedVehicles:
        """Replayed vehicles at the beginning, the scenario axis last."""
        return self._of_scenarios(
            lambda around: replayed_vehicles(_at(around.motion, 0, 0), _at(around.identity, 0)), case
        )

    def second(self, case: Int[Array, "*scenarios"], time: Int[Array, "*scenarios"]) -> BoundarySecond:
        """Recorded traffic around each scenario in one second, the scenario axis last.

        Args:
            case: Case of each scenario.
            time: Seconds since the start of the scenario [s]; after `n_seconds` the last second is repeated.
        """

        def second_of(around: "Surroundings", time: Array) -> BoundarySecond:
            after = replayed_vehicles(_at(around.motion, time + 1, 0), _at(around.identity, time + 1))
            return BoundarySecond(
                _at(around.motion, time), _at(around.identity, time), _at(around.entrants, time), after
            )

        return self._of_scenarios(second_of, case, jnp.minimum(time, self.n_seconds - 1))

    def _of_scenarios(self, function, case: Array, *others: Array):
        """Results of a function of one case's surroundings, for one scenario or for many along the last axis."""

        def of_scenario(case: Array, *others: Array):
            return function(_at(self, case), *others)

        return of_scenario(case, *others) if case.ndim == 0 else jax.vmap(of_scenario, out_axes=-1)(case, *others)


def surroundings_of(boundary: Boundary) -> Surroundings:
    """Surroundings made of a boundary whose scenes are the cases."""
    parts = boundary.motion, boundary.identity, boundary.entrants
    return Surroundings(*jax.tree.map(lambda leaf: jnp.moveaxis(leaf, -1, 0), parts))


def touches(
    state: TrafficState, vehicle: int, body: Body, replayed: ReplayedVehicles, model: TrafficModel
) -> Bool[Array, " scenarios"]:
    """True if a simulated vehicle touches a replayed one; replayed vehicles are in the middle of their lanes.

    Args:
        state: The traffic.
        vehicle: Index of the simulated vehicle.
        body: Sizes of the simulated vehicles; replayed vehicles have the width of the first simulated one.
        replayed: Recorded vehicles around the simulated ones.
        model: The road.
    """
    collides, row = jnp.ones((1, 1), bool), slice(vehicle, vehicle + 1)
    x, y, heading, speed = (values[row] for values in (state.x, state.y, state.heading, state.speed))
    length, half_width = jnp.broadcast_to(body.length, state.x.shape)[row], body.width[:1] / 2
    first = Rectangle(x, y, cosine(heading), sine(heading), speed, length / 2, half_width, collides)
    along = jnp.ones_like(replayed.x)
    second = Rectangle(
        replayed.x,
        replayed.lane.astype(x.dtype) * model.lane_width,
        along,
        jnp.zeros_like(along),
        replayed.speed,
        replayed.length / 2,
        half_width,
        collides,
    )
    return (separate(first, second, model)[0] & (replayed.lane != NOT_RECORDED)).any(axis=0)


def _at(values, *index: Array | int):
    """Values at an index of their first axes."""
    return jax.tree.map(lambda leaf: leaf[index], values)

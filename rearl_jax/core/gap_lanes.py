"""Comparison of lanes by car following on bumper-to-bumper gaps, with effects on the gain of a change.

The rules are those of `rearl_jax.core.mobil`; the deciding driver's parameters replace those of the followers, except
their desired speeds.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.lane_search import Neighbour, VehicleState, bumper_gap, find_ahead, find_behind, no_neighbour
from rearl_jax.core.mobil import LaneAccelerations, is_due, is_fast_enough, is_reachable, is_unsafe, lane_gains
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import DerivedState
from rearl_jax.core.state import TrafficState
from rearl_jax.core.stimuli import side_lane

Gains = tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]]
"""Gains of a change to the left and to the right [m/s^2]."""


class LaneOptions(eqx.Module):
    """Input to the comparison of lanes in one time step.

    Attributes:
        vehicles: Observable state of each vehicle, with the present desired speed of its driver.
        leader: The nearest vehicle ahead on the driver's lane.
        seen: Stimulus of each driver.
        driver: Car following of the drivers, with set points changed by the effects.
        memory: Memory of each effect.
    """

    vehicles: VehicleState
    leader: Neighbour
    seen: SimulatedStimulus
    driver: CarFollowing
    memory: tuple[PyTree, ...]

    def acceleration_behind(self, leader: Neighbour) -> Float[Array, "vehicles *scenarios"]:
        """Acceleration of each vehicle behind a leader [m/s^2]."""
        speed = self.vehicles.speed
        interaction = self.driver.interaction(bumper_gap(leader, self.vehicles), speed, speed - leader.vehicle.speed)
        return self.driver.free_acceleration(speed) - jnp.where(leader.is_there, interaction, 0.0)

    def follower_acceleration(
        self, follower: Neighbour, gap: Float[Array, "vehicles *scenarios"], front: Neighbour | None = None
    ) -> Float[Array, "vehicles *scenarios"]:
        """Acceleration of each vehicle's follower [m/s^2], 0 without a follower.

        Args:
            follower: The follower.
            gap: Bumper-to-bumper gap from the follower to the vehicle in front of it [m].
            front: Vehicle in front of the follower; None for the deciding vehicle itself.
        """
        rear = follower.vehicle
        front_speed = self.vehicles.speed if front is None else front.vehicle.speed
        # The deciding driver's parameters replace the follower's, except the desired speed.
        stand_in = self.driver.with_setpoints(rear.desired_speed, self.driver.time_gap, self.driver.jam_gap)
        interaction = stand_in.interaction(gap, rear.speed, rear.speed - front_speed)
        if front is not None:
            interaction = jnp.where(front.is_there, interaction, 0.0)
        return jnp.where(follower.is_there, stand_in.free_acceleration(rear.speed) - interaction, 0.0)

    def follower_behind_self(self, follower: Neighbour) -> Float[Array, "vehicles *scenarios"]:
        """Acceleration of a follower behind the deciding vehicle [m/s^2]."""
        return self.follower_acceleration(follower, bumper_gap(follower, self.vehicles))

    def follower_gain(self, follower: Neighbour, leader: Neighbour) -> Float[Array, "vehicles *scenarios"]:
        """Gain of a follower from the deciding vehicle's presence in front, usually negative [m/s^2].

        Without the deciding vehicle the follower would be behind `leader`.
        """
        gap = bumper_gap(leader, self.vehicles) + self.vehicles.length + bumper_gap(follower, self.vehicles)
        return self.follower_behind_self(follower) - self.follower_acceleration(follower, gap, leader)


def compare_lanes(
    state: TrafficState, derived: DerivedState, options: LaneOptions, drivers: Drivers, model: TrafficModel
) -> tuple[LaneAccelerations, Gains]:
    """Accelerations on each driver's lane and the adjacent lanes, and gains of a change including effects.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        options: Input of this time step.
        drivers: Parameters of all vehicles.
        model: Traffic model; only its road is used.
    """
    due, vehicles = is_due(state, derived, drivers), options.vehicles
    none = no_neighbour(vehicles)

    def search(lane: Int[Array, "vehicles *scenarios"]) -> tuple[Neighbour, Neighbour]:
        (ahead,) = if_any(due, lambda: find_ahead(state, derived, vehicles, lane, 1), (none,))
        return ahead, if_any(due, lambda: find_behind(state, derived, vehicles, lane), none)

    # The gain of the present follower ends with the change.
    present = options.follower_gain(search(derived.lane)[1], options.leader)
    sides, leaders, followers = [], [], []
    for direction in (-1, +1):
        leader, follower = search(derived.lane + direction)
        gain_of_others = options.follower_gain(follower, leader) - present
        sides.append(side_lane(direction, leader, follower, gain_of_others, vehicles))
        leaders.append(options.acceleration_behind(leader))
        followers.append(options.follower_behind_self(follower))
    own_acceleration = options.acceleration_behind(options.leader)
    accelerations = LaneAccelerations(own_acceleration, *leaders, *followers, *(side.gain_of_others for side in sides))
    gains = list(lane_gains(accelerations, drivers, model))
    for index, side in enumerate(sides):
        for effect, memory in zip(drivers.effects, options.memory, strict=True):
            gains[index] = effect.incentive(gains[index], side, options.seen, memory)
    return accelerations, (gains[0], gains[1])


def desired_side(
    state: TrafficState,
    derived: DerivedState,
    accelerations: LaneAccelerations,
    gains: Gains,
    drivers: Drivers,
    model: TrafficModel,
    *,
    before: Int[Array, "vehicles *scenarios"],
) -> Int[Array, "vehicles *scenarios"]:
    """Side to which a driver would have changed at the last decision if there had been room: -1 left, +1 right, else 0.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        accelerations: Accelerations on the lanes [m/s^2].
        gains: Gains of the changes [m/s^2].
        drivers: Parameters of all vehicles.
        model: Traffic model; only its road is used.
        before: Result of the last time step.
    """
    desired = jnp.zeros_like(before)
    due = is_due(state, derived, drivers)
    willing = due & is_fast_enough(state)
    followers = accelerations.left_follower, accelerations.right_follower
    for side, gain, follower in zip((-1, +1), gains, followers, strict=True):
        wants = willing & ~(gain < drivers.mobil.gain_threshold) & is_reachable(state, derived.lane + side, model)
        desired = jnp.where(wants & is_unsafe(follower, drivers), side, desired)
    return jnp.where(due, desired, before)

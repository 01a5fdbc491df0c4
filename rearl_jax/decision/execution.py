"""Execution of a policy's answers: admissible actions are followed for a limited time, then IDM and MOBIL continue."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.config.decision import ExecConfig, Longitudinal
from rearl_jax.core.meta_actions import MetaAction, apply_meta_actions
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, TrafficState, nearest_lane
from rearl_jax.decision.situation import N_ACTIONS, NO_ACTION
from rearl_jax.metrics.measure import unrolled_sum

MAX_SINCE_LANE_CHANGE = 1_000_000
"""Upper bound of the time since a lane change [s], also used if none was seen."""


class DecisionMemory(eqx.Module):
    """Memory of execution from second to second.

    Attributes:
        initial_desired_speed: Desired speed of each driver before the first decision [m/s].
        seconds_left: Remaining time of the present action [s]; 0 without an action.
        last_action: Action that each vehicle was given for the last second, NO_ACTION for none.
        lane: Lane at the end of the last second.
        since_lane_change: Time since the lane last differed from that of the second before [s].
    """

    initial_desired_speed: Float[Array, "vehicles scenarios"]
    seconds_left: Int[Array, "vehicles scenarios"]
    last_action: Int[Array, "vehicles scenarios"]
    lane: Int[Array, "vehicles scenarios"]
    since_lane_change: Int[Array, "vehicles scenarios"]


class Orders(eqx.Module):
    """Actions to follow in the coming second.

    Attributes:
        is_asked: True for vehicles that needed a decision.
        action: The action of those whose answer was accepted, NO_ACTION for all other vehicles.
        n_inadmissible: Vehicles whose answer was an inadmissible action.
        n_invalid: Vehicles without a valid answer.
    """

    is_asked: Bool[Array, "vehicles scenarios"]
    action: Int[Array, "vehicles scenarios"]
    n_inadmissible: Int[Array, " scenarios"]
    n_invalid: Int[Array, " scenarios"]


def model_under_decisions(model: TrafficModel, longitudinal: Longitudinal) -> TrafficModel:
    """The traffic model with decisions; `longitudinal` states whether vehicles with an action keep their distance."""
    return replace(model, meta_follows=longitudinal is Longitudinal.idm_capped)


def initial_decision_memory(state: TrafficState, model: TrafficModel) -> DecisionMemory:
    """Memory before the first second, in which no vehicle has an action."""
    zeros = jnp.zeros(state.x.shape, jnp.int32)
    return DecisionMemory(
        initial_desired_speed=state.desired_speed,
        seconds_left=zeros,
        last_action=zeros + NO_ACTION,
        lane=nearest_lane(state.y, model),
        since_lane_change=zeros + MAX_SINCE_LANE_CHANGE,
    )


def forget(
    memory: DecisionMemory, is_new: Bool[Array, "vehicles scenarios"], state: TrafficState, model: TrafficModel
) -> DecisionMemory:
    """The memory, reset to its initial values for vehicles that have just entered."""
    fresh = initial_decision_memory(state, model)
    return jax.tree.map(lambda initial, present: jnp.where(is_new, initial, present), fresh, memory)


def no_orders(state: TrafficState) -> Orders:
    """Orders for a second in which no vehicle gets an action."""
    no_vehicle = jnp.zeros(state.x.shape, bool)
    none = jnp.zeros(state.x.shape[1:], jnp.int32)
    return Orders(no_vehicle, jnp.full(state.x.shape, NO_ACTION, jnp.int32), none, none)


def count(mask: Bool[Array, "vehicles scenarios"]) -> Int[Array, " scenarios"]:
    """Number of marked vehicles in each scenario."""
    return unrolled_sum(mask.astype(jnp.int32), 0)


def accept(
    actions: Int[Array, "vehicles scenarios"],
    is_asked: Bool[Array, "vehicles scenarios"],
    admissible: Bool[Array, "actions vehicles scenarios"],
) -> Orders:
    """Orders from a policy's answers: only admissible actions of vehicles that need a decision."""
    is_action = (actions >= 0) & (actions < N_ACTIONS)
    is_admissible = jnp.zeros_like(is_asked)
    for action in range(N_ACTIONS):
        is_admissible = is_admissible | ((actions == action) & admissible[action])
    return Orders(
        is_asked=is_asked,
        action=jnp.where(is_asked & is_admissible, actions, NO_ACTION),
        n_inadmissible=count(is_asked & is_action & ~is_admissible),
        n_invalid=count(is_asked & ~is_action),
    )


def execute(
    state: TrafficState, memory: DecisionMemory, orders: Orders, model: TrafficModel, options: ExecConfig
) -> tuple[TrafficState, DecisionMemory]:
    """State and memory at the start of the second in which the orders are followed.

    A vehicle that gets an action follows it for `options.hold` seconds; a vehicle that needs a decision but gets no
    action is driven by IDM and MOBIL. KEEP, LEFT and RIGHT keep the target speed of a vehicle that followed an action
    in the second before; otherwise the target speed is the present speed, within the range of the speed levels. FASTER
    and SLOWER go to the level next to that of the present speed.

    After the action the target speed stays as desired speed (`options.persist_target`), or the driver's initial desired
    speed returns.

    Source: highway-env 1.12.1, `MDPVehicle.act`; REARL (Bi et al.): one step, then back to IDM and MOBIL.
    """
    is_new = orders.action != NO_ACTION
    was_driven = state.controller == Controller.META
    remaining = jnp.where(is_new, options.hold, jnp.maximum(memory.seconds_left - 1, 0))
    seconds_left = jnp.where(orders.is_asked & ~is_new, 0, remaining)
    is_driven = (seconds_left > 0) & (state.controller != Controller.ABSENT)
    controller = jnp.where(is_driven, int(Controller.META), int(Controller.IDM)).astype(jnp.int32)
    controller = jnp.where(was_driven | is_driven, controller, state.controller)

    present = jnp.clip(state.speed, model.speed_levels[0], model.speed_levels[-1])
    desired = jnp.where(is_driven & ~was_driven, present, state.desired_speed)
    if not options.persist_target:
        desired = jnp.where(was_driven & ~is_driven, memory.initial_desired_speed, desired)
    state = eqx.tree_at(lambda s: (s.controller, s.desired_speed), state, (controller, desired))
    state = apply_meta_actions(state, jnp.where(is_new, orders.action, int(MetaAction.IDLE)), model)
    memory = eqx.tree_at(lambda m: (m.seconds_left, m.last_action), memory, (seconds_left, orders.action))
    return state, memory


def record_lane_changes(memory: DecisionMemory, state: TrafficState, model: TrafficModel) -> DecisionMemory:
    """Memory after a simulated second, with the lane changes of that second."""
    lane = nearest_lane(state.y, model)
    since = jnp.where(lane != memory.lane, 0, jnp.minimum(memory.since_lane_change + 1, MAX_SINCE_LANE_CHANGE))
    return eqx.tree_at(lambda m: (m.lane, m.since_lane_change), memory, (lane, since))

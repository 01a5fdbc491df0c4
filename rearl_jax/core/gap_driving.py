"""Traffic whose drivers follow on the gap between bumpers, with effects: what takes the place of highway-env's rules.

Roads, clock, steering, the rules of changing lanes (when, how safe, which side) and collisions stay as they are.
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from rearl_jax.core.car_following.model import LEAST_DESIRED_SPEED, CarFollowing
from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.driving import Driving
from rearl_jax.core.encounter import Encounter, first_encounter, meet
from rearl_jax.core.following import begin_effects, respond, take_in, with_wishes
from rearl_jax.core.gap_lanes import Outlook, compare_lanes, wished_side
from rearl_jax.core.lane_search import bumper_gap, find_ahead
from rearl_jax.core.mobil import decide_lanes, is_due
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import View, sort_if_large
from rearl_jax.core.neighbours import perceive as view_of
from rearl_jax.core.state import Controller, TrafficState
from rearl_jax.core.stimuli import in_front, look_around, stimulus, traits_of


class DriverMemory(eqx.Module):
    """What drivers remember from one time step to the next.

    Attributes:
        n_ticks: Ticks since the start.
        encounter: Since when the leader has been the leader.
        effects: What each effect remembers.
        wished_side: -1 or +1 for drivers who at their last decision wanted to change to the left or right and found no
            room, else 0.
    """

    n_ticks: Int[Array, ""]
    encounter: Encounter
    effects: tuple[PyTree, ...]
    wished_side: Int[Array, "vehicles *scenarios"]


def begin_driving(state: TrafficState, drivers: Drivers, model: TrafficModel) -> TrafficState:
    """The state with what its drivers need at the start: their desired speeds and their memory.

    Drivers whose model has no desired speed keep that of the state; highway-env's, without effects, need no memory.
    """
    if drivers.car_following.desired_speed is not None:
        wanted = jnp.broadcast_to(drivers.car_following.desired_speed, state.x.shape)
        wanted = jnp.where(state.controller == Controller.IDM, wanted, state.desired_speed)
        state = replace(state, desired_speed=wanted)
    if not drivers.see_gaps:
        return state
    state = sort_if_large(state)
    view = view_of(state, model)
    traits = traits_of(state, view, drivers)
    around = look_around(state, view, traits)
    encounter = first_encounter(around.ahead[0].index, bumper_gap(around.ahead[0], traits))
    seen = stimulus(state, view, traits, around, encounter, view.lane, jnp.zeros((), state.x.dtype), model)
    held = begin_effects(drivers.effects, seen, _own_driver(state, drivers, model), model.dt)
    return replace(state, memory=DriverMemory(jnp.int32(0), encounter, held, jnp.zeros_like(state.target_lane)))


def weigh_gaps(state: TrafficState, view: View, drivers: Drivers, model: TrafficModel) -> Driving:
    """What drivers want behind their leaders, and on which lane.

    On the own lane and on the one it is changing to, a driver accelerates as the effects say; the latter is seen as it
    is, without delay or error. Lanes are compared by car following alone, with the driver's present desired speed and
    time gap, which stand in for the followers' too as in highway-env; then effects act on the gain.

    Raises:
        ValueError: The drivers have no memory yet.
    """
    memory = state.memory
    if memory is None:
        raise ValueError("these drivers have a memory: start from begin_driving(state, drivers, model)")
    traits = traits_of(state, view, drivers)
    around = look_around(state, view, traits)
    leader = around.ahead[0]
    encounter = meet(memory.encounter, leader.index, bumper_gap(leader, traits), traits.speed, model.dt)
    wanted_lane = jnp.where(view.lane == state.target_lane, view.lane + memory.wished_side, state.target_lane)
    time = memory.n_ticks.astype(state.x.dtype) * model.dt
    seen = stimulus(state, view, traits, around, encounter, wanted_lane, time, model)
    effects, driver = drivers.effects, _own_driver(state, drivers, model)
    perceived, held = take_in(seen, driver, effects, memory.effects, model.dt)
    present = with_wishes(perceived, driver, effects, held)
    at_rest_after = -jnp.maximum(state.speed, 0.0) / model.dt

    def on_target_lane() -> Float[Array, "vehicles *scenarios"]:
        (ahead,) = find_ahead(state, view, traits, state.target_lane, 1)
        there = replace(seen, **in_front(ahead, traits), has_second=jnp.zeros_like(state.x))
        return respond(there, with_wishes(there, driver, effects, held), effects, held)

    is_changing = (state.controller != Controller.ABSENT) & (view.lane != state.target_lane)
    nothing = jnp.zeros_like(state.x)
    own = jnp.maximum(respond(perceived, present, effects, held), at_rest_after)
    target = jnp.maximum(if_any(is_changing, on_target_lane, nothing), at_rest_after)
    left = right = nothing
    target_lane, wishes = state.target_lane, memory.wished_side
    if model.lane_changes:
        traits = replace(traits, desired_speed=jnp.broadcast_to(present.desired_speed, state.x.shape))
        outlook = Outlook(traits, leader, seen, present, held)
        prospects, gains = compare_lanes(state, view, outlook, drivers, model)
        left, right = prospects.left, prospects.right
        due = is_due(state, view, drivers)
        target_lane = decide_lanes(state, view, due, prospects, gains, drivers, model)
        wishes = wished_side(state, view, prospects, gains, drivers, model, before=wishes)

    def on_lane(lane: Int[Array, "vehicles *scenarios"]) -> Float[Array, "vehicles *scenarios"]:
        beside = jnp.where(lane < view.lane, left, right)
        return jnp.where(lane == state.target_lane, target, beside)

    memory = DriverMemory(memory.n_ticks + 1, encounter, held, wishes)
    return Driving(replace(state, memory=memory), own, target_lane, on_lane)


def _own_driver(state: TrafficState, drivers: Drivers, model: TrafficModel) -> CarFollowing:
    """The drivers' car following with the desired speeds of the state, under the road's limit."""
    desired_speed = jnp.clip(state.desired_speed, LEAST_DESIRED_SPEED, model.speed_limit)
    return replace(drivers.car_following, desired_speed=desired_speed).full(state.x.shape)

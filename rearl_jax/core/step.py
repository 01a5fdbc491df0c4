"""One time step of the traffic, as the list of its stages."""

from rearl_jax.core.collisions import collide
from rearl_jax.core.conflicts import abort_conflicts
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.gap_driving import drive_by_gaps
from rearl_jax.core.idm_driving import drive_by_idm
from rearl_jax.core.kinematics import control, move
from rearl_jax.core.mobil import restart_countdown
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import derive_state, sort_if_large
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import TrafficState


def step(
    state: TrafficState, drivers: Drivers, model: TrafficModel, replayed: ReplayedVehicles | None = None
) -> TrafficState:
    """State one time step later: see, evaluate the lanes, decide, give way, accelerate and steer, move, collide.

    highway-env's drivers without effects evaluate the lanes as in highway-env; all others use their car-following model
    and their effects, and need a state prepared by `begin_driving`. All drivers see the replayed vehicles around the
    simulated ones.

    Source: highway-env 1.12.1, `Road.act` followed by `Road.step`; the order of its vehicle list only
        decides which vehicle gives way and which vehicle pushes which, and both are reproduced.
    """
    return step_in_order(sort_if_large(state), drivers, model, replayed)


def step_in_order(
    state: TrafficState, drivers: Drivers, model: TrafficModel, replayed: ReplayedVehicles | None = None
) -> TrafficState:
    """State one time step later, as in `step`. `state.order` must be up to date; that of the result is."""
    derived = derive_state(state, model, replayed)
    drive = drive_by_gaps if drivers.see_gaps else drive_by_idm
    state, own_acceleration, target_lane, acceleration_on = drive(state, derived, drivers, model)
    countdown = state.ticks_to_decision
    if model.lane_changes:
        countdown = restart_countdown(state, derived, drivers)
        target_lane = abort_conflicts(target_lane, state, derived, drivers, model)
    command = control(state, derived, target_lane, own_acceleration, acceleration_on(target_lane), drivers, model)
    state = sort_if_large(move(state, derived, target_lane, countdown, command, drivers, model))
    if model.collisions:
        state = collide(state, drivers.body, model)
    return state

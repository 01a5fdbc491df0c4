"""Moving vehicles: the lateral controller, the speed controllers and the kinematic bicycle.

highway-env's steering angle delta is not needed: only the slip angle beta = arctan(tan(delta) / 2) moves the vehicle,
and since the controller sets delta = arctan(2 tan(arcsin u)), the sine of the slip angle is u itself, limited to the
value of the largest steering angle. In float32 the direction of motion therefore follows from the heading by products
alone. In float64 all functions are evaluated as in highway-env, to reproduce its rounding.

Source: highway-env 1.12.1, `vehicle/controller.py` (ControlledVehicle) and `vehicle/kinematics.py` (Vehicle.step).
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from rearl_jax.core.compaction import if_any
from rearl_jax.core.double_double import arctangent, rounded
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.elementary import arcsine, cosine, not_zero, sine
from rearl_jax.core.following import actuate
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import DerivedState
from rearl_jax.core.state import Controller, TrafficState

HEADING_TIME = 0.2
"""Time constant of the heading controller [s]. Source: highway-env 1.12.1, `ControlledVehicle.TAU_HEADING`."""

LATERAL_TIME = 0.6
"""Time constant of the lateral position controller [s]. Source: highway-env 1.12.1, `ControlledVehicle.TAU_LATERAL`."""

SPEED_TIME = 0.6
"""Time constant of the speed controller of META vehicles [s]. Source: highway-env 1.12.1,
`ControlledVehicle.TAU_ACC`.
"""

MAX_SPEED = 40.0
"""Speed [m/s], forwards and backwards, above which a vehicle is decelerated. Source: highway-env 1.12.1,
`Vehicle.MAX_SPEED`.
"""

MAX_HEADING = np.pi / 4
"""Largest heading commanded by the lateral controller [rad]. Source: highway-env 1.12.1, `steering_control`."""

MAX_STEERING = np.pi / 3
"""Largest steering angle [rad]. Source: highway-env 1.12.1, `ControlledVehicle.MAX_STEERING_ANGLE`."""

MAX_SINE_OF_SLIP = float(np.sin(np.arctan(np.tan(MAX_STEERING) / 2)))
"""Sine of the slip angle at the largest steering angle [-]."""


class Command(eqx.Module):
    """Command to a vehicle in this time step.

    Attributes:
        acceleration: Acceleration along the heading [m/s^2].
        sine_of_slip: Commanded sine of the slip angle beta between heading and motion [-]; `course` limits it to the
            largest steering angle.
    """

    acceleration: Float[Array, "vehicles *scenarios"]
    sine_of_slip: Float[Array, "vehicles *scenarios"]


class Course(NamedTuple):
    """Direction of motion of a vehicle: its cosine and sine, and the sine of the slip angle [-]."""

    cos: Float[Array, "vehicles *scenarios"]
    sin: Float[Array, "vehicles *scenarios"]
    sine_of_slip: Float[Array, "vehicles *scenarios"]


def wrap_to_pi(angle: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Direction within [-pi, pi) [rad]. Source: highway-env 1.12.1, `utils.wrap_to_pi`."""
    turned = angle + np.pi
    return (turned - 2 * np.pi * jnp.floor(turned / (2 * np.pi))) - np.pi


def course(state: TrafficState, derived: DerivedState, sine_of_slip: Float[Array, "vehicles *scenarios"]) -> Course:
    """Direction of motion at a commanded sine of the slip angle, limited to the largest steering angle."""
    if sine_of_slip.dtype == jnp.float64:
        at_rest = Course(*(jnp.zeros_like(sine_of_slip),) * 3)
        return if_any(state.speed != 0, lambda: _course_by_angles(state.heading, sine_of_slip), at_rest)
    sin_slip = jnp.clip(sine_of_slip, -MAX_SINE_OF_SLIP, MAX_SINE_OF_SLIP)
    cos_slip = jnp.sqrt(1 - sin_slip * sin_slip)
    return Course(
        cos=derived.cos_heading * cos_slip - derived.sin_heading * sin_slip,
        sin=derived.sin_heading * cos_slip + derived.cos_heading * sin_slip,
        sine_of_slip=sin_slip,
    )


def _course_by_angles(heading: Float[Array, "*n"], sine_of_slip: Float[Array, "*n"]) -> Course:
    """Course computed through the steering angle, with the rounding of highway-env."""
    steering = arctangent(2 * jnp.tan(arcsine(sine_of_slip)))
    slip = arctangent(jnp.tan(jnp.clip(steering, -MAX_STEERING, MAX_STEERING)) / 2)
    return Course(cosine(heading + slip), sine(heading + slip), sine(slip))


def steer(
    state: TrafficState, target_lane: Int[Array, "vehicles *scenarios"], drivers: Drivers, model: TrafficModel
) -> Float[Array, "vehicles *scenarios"]:
    """Sine of the slip angle [-] that brings a vehicle to the centre of its target lane.

    A cascade: lateral offset -> lateral speed -> heading -> turn rate -> slip angle.

    Source: highway-env 1.12.1, `ControlledVehicle.steering_control`.
    """
    speed = not_zero(state.speed)
    offset = state.y - target_lane.astype(state.y.dtype) * model.lane_width
    lateral_speed = -(1 / LATERAL_TIME) * offset
    heading = jnp.clip(arcsine(lateral_speed / speed), -MAX_HEADING, MAX_HEADING)
    turn_rate = (1 / HEADING_TIME) * wrap_to_pi(heading - state.heading)
    return drivers.body.length / 2 / speed * turn_rate


def control(
    state: TrafficState,
    derived: DerivedState,
    target_lane: Int[Array, "vehicles *scenarios"],
    own_acceleration: Float[Array, "vehicles *scenarios"],
    target_acceleration: Float[Array, "vehicles *scenarios"],
    drivers: Drivers,
    model: TrafficModel,
) -> Command:
    """Command of every vehicle: IDM, meta-action target, braking to rest after a crash, or zero if absent.

    A vehicle that is changing lanes reacts to the leaders of both lanes.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        target_lane: Target lanes of the vehicles.
        own_acceleration: Car-following accelerations behind the leaders on the present lanes [m/s^2].
        target_acceleration: Car-following accelerations on the target lane, if it differs [m/s^2].
        drivers: Parameters of all vehicles.
        model: The road and its clock.

    Source: highway-env 1.12.1, `IDMVehicle.act`, `ControlledVehicle.act`, `Vehicle.clip_actions`.
    """
    following = jnp.where(
        target_lane == derived.lane, own_acceleration, jnp.minimum(own_acceleration, target_acceleration)
    )
    if drivers.effects:
        following = actuate(following, state.acceleration, drivers.effects, model.dt)
        following = jnp.maximum(following, -jnp.maximum(state.speed, 0.0) / model.dt)  # not backwards
    following = jnp.clip(following, -drivers.body.accel_limit, drivers.body.accel_limit)
    tracking = (1 / SPEED_TIME) * (state.desired_speed - state.speed)
    if model.meta_follows:
        limit = drivers.body.accel_limit
        tracking = jnp.clip(jnp.minimum(tracking, following), -limit, limit)
    acceleration = jnp.where(state.controller == Controller.IDM, following, tracking)
    acceleration = jnp.where(state.crashed, -state.speed, acceleration)
    # Beyond the bounds of the speed, the acceleration brings it back; the two cases exclude each other.
    to_max, to_min = MAX_SPEED - state.speed, -MAX_SPEED - state.speed
    acceleration = jnp.where(to_max < 0, jnp.minimum(acceleration, to_max), acceleration)
    acceleration = jnp.where(to_min > 0, jnp.maximum(acceleration, to_min), acceleration)
    is_present = state.controller != Controller.ABSENT
    steers = is_present & ~state.crashed
    slip = if_any(steers, lambda: steer(state, target_lane, drivers, model), jnp.zeros_like(state.y))
    return Command(jnp.where(is_present, acceleration, 0.0), jnp.where(steers, slip, 0.0))


def add_compensated(
    sum_so_far: Float[Array, "*n"], step: Float[Array, "*n"], lost: Float[Array, "*n"]
) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Sum with its accumulated rounding error (Kahan), so that 900 small steps do not drift in float32.

    In float64 the plain sum, to reproduce the rounding of highway-env.
    """
    if sum_so_far.dtype == jnp.float64:
        return sum_so_far + step, lost
    step = step - lost
    new_sum = sum_so_far + step
    return new_sum, (new_sum - sum_so_far) - step


def move(
    state: TrafficState,
    derived: DerivedState,
    target_lane: Int[Array, "vehicles *scenarios"],
    countdown: Int[Array, "vehicles *scenarios"],
    command: Command,
    drivers: Drivers,
    model: TrafficModel,
) -> TrafficState:
    """State after one explicit Euler step of the kinematic bicycle, including displacements by collisions of the last
    time step.

    Position and heading advance with the old speed. A displaced vehicle counts as crashed from this step on.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        target_lane: Lanes the vehicles are steered to.
        countdown: Ticks to the next lane-change decision before this step.
        command: Command of every vehicle.
        drivers: Parameters of all vehicles.
        model: The road and its clock.

    Source: highway-env 1.12.1, `Vehicle.step`; bicycle: Polack et al., IEEE IV 2017.
    """
    dt = model.dt
    motion = course(state, derived, command.sine_of_slip)
    x, x_lost = add_compensated(state.x, rounded(state.speed * motion.cos * dt), state.x_lost)
    y, y_lost = add_compensated(state.y, rounded(state.speed * motion.sin * dt), state.y_lost)
    turn_rate = state.speed * motion.sine_of_slip / (drivers.body.length / 2)
    return TrafficState(
        x=x + jnp.where(state.is_pushed, state.push_x, 0.0),
        y=y + jnp.where(state.is_pushed, state.push_y, 0.0),
        x_lost=x_lost,
        y_lost=y_lost,
        heading=state.heading + rounded(turn_rate * dt),
        speed=state.speed + rounded(command.acceleration * dt),
        acceleration=command.acceleration,
        desired_speed=state.desired_speed,
        target_lane=target_lane,
        ticks_to_decision=countdown - 1,
        controller=state.controller,
        crashed=state.crashed | state.is_pushed,
        is_pushed=jnp.zeros_like(state.is_pushed),
        push_x=jnp.zeros_like(state.push_x),
        push_y=jnp.zeros_like(state.push_y),
        order=state.order,
        memory=state.memory,
        n_crashed_replaced=state.n_crashed_replaced,
    )

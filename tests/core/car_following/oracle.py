"""Every car-following model once more: scalar formulas from the literature, their equilibrium gaps and their slopes.

Nothing here is differentiated by a machine. The slopes are derived by hand at the equilibrium gap s_e(v), where the
leader drives at the same speed v below the desired speed v0 and nothing but the leader limits the follower:

    f_s = df/ds,   f_v = df/dv at constant approach rate,   f_dv = df/d(dv)

A platoon is string stable where f_v^2 + 2 f_v f_dv - 2 f_s >= 0 (Treiber & Kesting, Traffic Flow Dynamics (2013),
section 15.3).

Names: s gap between bumpers [m], v own speed [m/s], dv own minus leader's speed [m/s]; parameters as declared. Where a
formula has no answer for a vehicle that reverses for a moment, the vehicle counts as standing.
"""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

SMALLEST_GAP = 0.5
"""Gap [m] below which no driver who divides by it answers more strongly; the models' own regularisation."""

HIGHWAY_ENV_LENGTH = 5.0
"""Length [m] between centre and bumpers of two of highway-env's vehicles, `Vehicle.LENGTH`."""

SLOWEST_ROOT = 0.1
"""Least speed [m/s] that Gipps' root may be; the model's own regularisation."""

Parameters = SimpleNamespace


class Slopes(NamedTuple):
    """Slopes of the acceleration at equilibrium: f_s [1/s^2], f_v [1/s], f_dv [1/s]."""

    gap: float
    speed: float
    approach_rate: float

    @property
    def margin(self) -> float:
        """f_v^2 + 2 f_v f_dv - 2 f_s [1/s^2]."""
        return self.speed**2 + 2 * self.speed * self.approach_rate - 2 * self.gap

    def gain(self, frequency: complex) -> float:
        """Amplitude of a follower's speed over its leader's where the time derivative is a factor.

        From dv/dt = f_s s + f_v v + f_dv (v - v_l) and ds/dt = v_l - v with the derivative replaced by z = i omega:

            v / v_l = (f_s - z f_dv) / (z^2 - z (f_v + f_dv) + f_s)

        Args:
            frequency: z / i [rad/s]; real in continuous time.
        """
        z = 1j * frequency
        return abs((self.gap - z * self.approach_rate) / (z * z - z * (self.speed + self.approach_rate) + self.gap))

    def gain_in_steps(self, frequency: float, step: float) -> float:
        """The same where place and speed advance in explicit Euler steps [s]: z = (exp(i omega dt) - 1) / dt."""
        z = (complex(math.cos(frequency * step), math.sin(frequency * step)) - 1) / step
        return self.gain(z / 1j)


class Oracle(NamedTuple):
    """One model.

    Attributes:
        free: Acceleration on a free road, of v and the parameters.
        acceleration: Of s, v, dv and the parameters.
        equilibrium_gap: Of v and the parameters.
        slopes: Of v and the parameters.
    """

    free: Callable[[float, Parameters], float]
    acceleration: Callable[[float, float, float, Parameters], float]
    equilibrium_gap: Callable[[float, Parameters], float]
    slopes: Callable[[float, Parameters], Slopes]


# Every model but IDM, highway-env's and FVDM keeps the gap s0 + v T in equilibrium.


def linear_equilibrium_gap(v, p):
    return p.jam_gap + v * p.time_gap


# Intelligent Driver Model: Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805, eqs. 3 to 5.


def idm_desired_gap(v, dv, p):
    """s* = s0 + max(0, v T + v dv / (2 sqrt(a b)))."""
    return p.jam_gap + max(0.0, highway_env_desired_gap(v, dv, p) - p.jam_gap)


def idm_free(v, p, exponent=4.0):
    return p.max_accel * (1 - (max(v, 0.0) / p.desired_speed) ** exponent)


def idm_acceleration(s, v, dv, p):
    return idm_free(v, p) - p.max_accel * (idm_desired_gap(v, dv, p) / max(s, SMALLEST_GAP)) ** 2


def idm_equilibrium_gap(v, p, exponent=4.0, length=0.0):
    return (linear_equilibrium_gap(v, p) + length) / math.sqrt(1 - (v / p.desired_speed) ** exponent) - length


def idm_slopes(v, p, exponent=4.0, length=0.0):
    """With F = 1 - (v / v0)^delta and L = s0 + v T, so that s_e = L / sqrt(F) and (L / s_e)^2 = F."""
    a, free, wanted = p.max_accel, 1 - (v / p.desired_speed) ** exponent, linear_equilibrium_gap(v, p) + length
    return Slopes(
        gap=2 * a * free**1.5 / wanted,
        speed=-a * (exponent * v ** (exponent - 1) / p.desired_speed**exponent + 2 * p.time_gap * free / wanted),
        approach_rate=-v * math.sqrt(a / p.comfort_decel) * free / wanted,
    )


# Improved IDM: Treiber & Kesting, Traffic Flow Dynamics (2013), section 11.3.7.


def improved_free(v, p):
    a, b, ratio = p.max_accel, p.comfort_decel, max(v, 0.0) / p.desired_speed
    return a * (1 - ratio**4) if ratio <= 1 else -b * (1 - ratio ** (-4 * a / b))


def improved_acceleration(s, v, dv, p):
    z, a, free = idm_desired_gap(v, dv, p) / max(s, SMALLEST_GAP), p.max_accel, improved_free(v, p)
    if v > p.desired_speed:
        return free + a * (1 - z * z) if z >= 1 else free
    return a * (1 - z * z) if z >= 1 else free * (1 - z ** (2 * a / free))


def improved_slopes(v, p):
    """Of a (1 - z^2) at z = 1; those of f (1 - z^(2 a / f)) are the same there."""
    a, gap = p.max_accel, linear_equilibrium_gap(v, p)
    return Slopes(
        gap=2 * a / gap, speed=-2 * a * p.time_gap / gap, approach_rate=-v * math.sqrt(a / p.comfort_decel) / gap
    )


# highway-env 1.12.1, IDMVehicle.acceleration: the same between centres, any exponent, s* not cut at zero.


def highway_env_desired_gap(v, dv, p):
    """s* between centres less one vehicle length."""
    return p.jam_gap + v * p.time_gap + v * dv / (2 * math.sqrt(p.max_accel * p.comfort_decel))


def highway_env_free(v, p):
    return idm_free(v, p, p.accel_exponent)


def highway_env_acceleration(s, v, dv, p):
    distance = max(s + HIGHWAY_ENV_LENGTH, SMALLEST_GAP)
    wanted = highway_env_desired_gap(v, dv, p) + HIGHWAY_ENV_LENGTH
    return highway_env_free(v, p) - p.max_accel * (wanted / distance) ** 2


def highway_env_equilibrium_gap(v, p):
    return idm_equilibrium_gap(v, p, p.accel_exponent, HIGHWAY_ENV_LENGTH)


def highway_env_slopes(v, p):
    return idm_slopes(v, p, p.accel_exponent, HIGHWAY_ENV_LENGTH)


# IDM with an approach gain of its own: the speed control and the relative-speed term of Milanes & Shladover, Transp.
# Res. C 48 (2014) 285, around the gap term of IDM.


def approach_gain_free(v, p):
    return min(p.max_accel, proportional_free(v, p))


def approach_gain_acceleration(s, v, dv, p):
    ratio = (p.jam_gap + max(v, 0.0) * p.time_gap) / max(s, SMALLEST_GAP)
    following = p.max_accel * (1 - ratio**p.gap_exponent) - p.approach_gain * dv
    return min(following, proportional_free(v, p))


def approach_gain_slopes(v, p):
    steepness = p.max_accel * p.gap_exponent / (p.jam_gap + v * p.time_gap)
    return Slopes(gap=steepness, speed=-steepness * p.time_gap, approach_rate=-p.approach_gain)


# Constant time headway: Milanes & Shladover (2014), eq. 3.


def proportional_free(v, p):
    return p.speed_gain * (p.desired_speed - v)


def headway_acceleration(s, v, dv, p):
    error = s - p.jam_gap - v * p.time_gap
    return min(p.gap_gain * error - p.approach_gain * dv, proportional_free(v, p))


def headway_slopes(v, p):
    return Slopes(gap=p.gap_gain, speed=-p.gap_gain * p.time_gap, approach_rate=-p.approach_gain)


# Full velocity difference model: Jiang, Wu & Zhu, Phys. Rev. E 64 (2001) 017101, eq. 6.


def fvdm_acceleration(s, v, dv, p):
    reach = p.desired_speed * p.time_gap
    optimal = p.desired_speed * math.tanh(max(s - p.jam_gap, 0.0) / reach)
    return p.speed_gain * (optimal - v) - p.approach_gain * dv


def fvdm_equilibrium_gap(v, p):
    """s0 + v0 T artanh(v / v0), the inverse hyperbolic tangent as a logarithm."""
    ratio = v / p.desired_speed
    return p.jam_gap + p.desired_speed * p.time_gap * 0.5 * math.log((1 + ratio) / (1 - ratio))


def fvdm_slopes(v, p):
    """With V'(s_e) = (1 - (v / v0)^2) / T."""
    steepness = (1 - (v / p.desired_speed) ** 2) / p.time_gap
    return Slopes(gap=p.speed_gain * steepness, speed=-p.speed_gain, approach_rate=-p.approach_gain)


# Gipps: Transp. Res. B 15 (1981) 105, eqs. 2 and 5, with a margin of half a reaction time and the leader's braking
# taken for the own.


def gipps_free(v, p):
    ratio = v / p.desired_speed
    return 2.5 * p.max_accel * (1 - ratio) * math.sqrt(0.025 + max(ratio, 0.0))


def gipps_acceleration(s, v, dv, p):
    tau, b, leader = p.time_gap / 1.5, p.comfort_decel, max(v - dv, 0.0)
    square = b**2 * tau**2 + b * (2 * (s - p.jam_gap) - v * tau) + leader**2
    safe = -b * tau + math.sqrt(max(square, SLOWEST_ROOT**2))
    return min(gipps_free(v, p), (safe - v) / tau)


def gipps_slopes(v, p):
    """With R = v + b tau: d(safe)/ds = b / R, d(safe)/dv = (2 v - b tau) / (2 R), d(safe)/d(dv) = -v / R."""
    tau, b = p.time_gap / 1.5, p.comfort_decel
    root = v + b * tau
    return Slopes(gap=b / (root * tau), speed=-1.5 * b / root, approach_rate=-v / (root * tau))


# Krauss: Microscopic Modeling of Traffic Flow (1998), eqs. 3.12 to 3.15.


def krauss_free(v, p):
    return min(p.max_accel, (p.desired_speed - v) / p.time_gap)


def krauss_acceleration(s, v, dv, p):
    leader = max(v - dv, 0.0)
    time = (max(v, 0.0) + leader) / (2 * p.comfort_decel) + p.time_gap
    safe = leader + (s - p.jam_gap - leader * p.time_gap) / time
    return min(p.max_accel, (min(p.desired_speed, safe) - v) / p.time_gap)


def krauss_slopes(v, p):
    """With D = v / b + T: d(safe)/ds = 1 / D, d(safe)/dv = 1 - T / D, d(safe)/d(dv) = -(1 - T / D)."""
    time = v / p.comfort_decel + p.time_gap
    return Slopes(
        gap=1 / (time * p.time_gap),
        speed=-1 / time,
        approach_rate=-v / (p.comfort_decel * time * p.time_gap),
    )


ORACLES: dict[str, Oracle] = {
    "idm": Oracle(idm_free, idm_acceleration, idm_equilibrium_gap, idm_slopes),
    "improved_idm": Oracle(improved_free, improved_acceleration, linear_equilibrium_gap, improved_slopes),
    "highway_env_idm": Oracle(
        highway_env_free, highway_env_acceleration, highway_env_equilibrium_gap, highway_env_slopes
    ),
    "approach_gain_idm": Oracle(
        approach_gain_free, approach_gain_acceleration, linear_equilibrium_gap, approach_gain_slopes
    ),
    "constant_time_headway": Oracle(proportional_free, headway_acceleration, linear_equilibrium_gap, headway_slopes),
    "fvdm": Oracle(proportional_free, fvdm_acceleration, fvdm_equilibrium_gap, fvdm_slopes),
    "gipps": Oracle(gipps_free, gipps_acceleration, linear_equilibrium_gap, gipps_slopes),
    "krauss": Oracle(krauss_free, krauss_acceleration, linear_equilibrium_gap, krauss_slopes),
}
"""Every model by its name."""

DESIRED_GAPS = {"idm": idm_desired_gap, "improved_idm": idm_desired_gap, "highway_env_idm": highway_env_desired_gap}
"""Desired gaps [m] of the models whose drivers want another than that at equilibrium, of v, dv and the parameters."""

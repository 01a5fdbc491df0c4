"""Car following: the Intelligent Driver Model as highway-env implements it.

    a [1 - (max(v, 0) / |v0|)^delta - (s* / s)^2]   with   s* = s0 + v T + v dv / (2 sqrt(a b))

Two deviations from the published model matter: distances are centre to centre (s0 holds one vehicle length), and
s* is not cut at zero, so a leader that drives away fast enough makes its follower brake.

Source: Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805; highway-env 1.12.1, `IDMVehicle.acceleration`.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.double_double import rounded
from rearl_jax.core.drivers import IDMParams
from rearl_jax.core.elementary import power
from rearl_jax.core.neighbours import not_zero


def free_acceleration(*, speed_ratio: Float[Array, "*n"], params: IDMParams) -> Float[Array, "*n"]:
    """Acceleration on a free road [m/s^2]: a [1 - (v / v0)^delta]; without bound below where v > v0.

    Args:
        speed_ratio: max(v, 0) / |v0| [-].
        params: Of the driver who evaluates.
    """
    return rounded(params.max_accel * (1 - power(speed_ratio, params.accel_exponent)))


def approach_rate(
    speed_x: Float[Array, "*n"],
    speed_y: Float[Array, "*n"],
    leader_speed_x: Float[Array, "*#n"],
    leader_speed_y: Float[Array, "*#n"],
    *,
    cos_heading: Float[Array, "*n"],
    sin_heading: Float[Array, "*n"],
) -> Float[Array, "*n"]:
    """Approach rate dv, own minus leader's velocity along the own heading [m/s]; positive = closing.

    Source: highway-env 1.12.1, `IDMVehicle.desired_gap` (projected).
    """
    return rounded((speed_x - leader_speed_x) * cos_heading) + (speed_y - leader_speed_y) * sin_heading


def desired_spacing(*, speed: Float[Array, "*n"], dv: Float[Array, "*n"], params: IDMParams) -> Float[Array, "*n"]:
    """Spacing s* a driver wants to a leader, centre to centre [m].

    Args:
        speed: Own speed [m/s].
        dv: Approach rate, own minus leader's speed along the own heading [m/s].
        params: Of the driver who evaluates.
    """
    v, a, b = speed, params.max_accel, params.comfort_decel
    return params.jam_spacing + rounded(v * params.time_gap) + v * dv / (2 * jnp.sqrt(a * b))


def interaction(
    *, distance: Float[Array, "*n"], speed: Float[Array, "*n"], dv: Float[Array, "*n"], params: IDMParams
) -> Float[Array, "*n"]:
    """Deceleration because of a leader [m/s^2], positive: a (s* / s)^2; 0 at distance inf.

    Args:
        distance: To the leader, centre to centre [m]; inf without one.
        speed: Own speed [m/s].
        dv: Approach rate [m/s].
        params: Of the driver who evaluates.
    """
    ratio = desired_spacing(speed=speed, dv=dv, params=params) / not_zero(distance)
    return rounded(params.max_accel * (ratio * ratio))

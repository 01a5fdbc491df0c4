"""The Intelligent Driver Model as published: on the gap between bumpers, the desired gap never below the jam gap.

    a [1 - (v / v0)^4 - (s* / s)^2]   with   s* = s0 + max(0, v T + v dv / (2 sqrt(a b)))

`rearl_jax.core.idm` holds highway-env's form, which measures from centre to centre; this one is what trajectories are
calibrated with, and what a repaired model drives by.

Source: Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

SMALLEST_GAP = 0.5
"""Gap [m] below which the interaction grows no further; measured gaps may be negative."""


class FollowingParams(eqx.Module):
    """Parameters of the Intelligent Driver Model in gap form; one value per vehicle.

    Attributes:
        desired_speed: v0 [m/s].
        time_gap: T [s].
        jam_gap: s0, bumper to bumper at standstill [m].
        max_accel: a [m/s^2].
        comfort_decel: b, positive [m/s^2].
    """

    desired_speed: Float[Array, "*#n"]
    time_gap: Float[Array, "*#n"]
    jam_gap: Float[Array, "*#n"]
    max_accel: Float[Array, "*#n"]
    comfort_decel: Float[Array, "*#n"]


def gap_interaction(
    gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], dv: Float[Array, "*#n"], params: FollowingParams
) -> Float[Array, "*n"]:
    """Squared ratio of desired to actual gap, (s* / s)^2 [-].

    Args:
        gap: Bumper to bumper [m].
        speed: Own speed [m/s].
        dv: Approach rate, own minus leader's speed [m/s].
        params: Of the driver.
    """
    dynamic = speed * params.time_gap + speed * dv / (2 * jnp.sqrt(params.max_accel * params.comfort_decel))
    ratio = (params.jam_gap + jnp.maximum(dynamic, 0.0)) / jnp.maximum(gap, SMALLEST_GAP)
    return ratio * ratio


def free_term(speed: Float[Array, "*#n"], desired_speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
    """(v / v0)^4 [-]."""
    ratio = jnp.maximum(speed, 0.0) / desired_speed
    square = ratio * ratio
    return square * square

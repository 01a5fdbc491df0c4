"""A driver's own parameters as five standard numbers: logarithms, in units of how much drivers differ.

Source: spread of calibrated parameters, Kesting & Treiber, Transp. Res. Rec. 2088 (2008) 148; usual values for
motorways, Treiber & Kesting, Traffic Flow Dynamics (2013), table 11.2.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.core.gap_idm import FollowingParams

NAMES = ("desired_speed", "time_gap", "jam_gap", "max_accel", "comfort_decel")

CAR = np.array([32.0, 1.25, 2.5, 1.4, 2.0])
"""Usual desired speed [m/s], time gap [s], jam gap [m], acceleration and deceleration [m/s^2] of a car."""

TRUCK = np.array([25.0, 1.6, 2.5, 0.9, 2.0])
"""The same of a truck."""

SPREAD = np.array([0.12, 0.3, 0.3, 0.3, 0.35])
"""Standard deviation of the parameters' logarithms between drivers [-]."""

FURTHEST = 4.0
"""Bound of a standardised parameter [-]."""


def following_params(z: Float[Any, "own pieces"], is_truck: Float[Any, " pieces"]) -> FollowingParams:
    """Car-following parameters of drivers whose standardised parameters are z."""
    truck = jnp.asarray(is_truck)[None]
    usual = jnp.log(CAR)[:, None] * (1 - truck) + jnp.log(TRUCK)[:, None] * truck
    return FollowingParams(*jnp.exp(usual + jnp.asarray(SPREAD)[:, None] * z))

"""Keys of the lane-change model."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range

_SOURCE = "highway-env 1.12.1, IDMVehicle"

BOUNDS = {"politeness": (-1.0, 10.0), "gain_threshold": (-10.0, 10.0), "safe_decel": (0.0, 20.0), "delay": (0.05, 60.0)}
"""Bounds of the keys, in their units."""


@dataclass(unsafe_hash=True)
class MobilConfig:
    """Lane changes by MOBIL (Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86)."""

    politeness: float = key(0.0, f"politeness p, the weight of the followers' gain [-]; {_SOURCE}.POLITENESS")
    gain_threshold: float = key(
        0.2, f"smallest gain in acceleration for a lane change [m/s^2]; {_SOURCE}.LANE_CHANGE_MIN_ACC_GAIN"
    )
    safe_decel: float = key(
        2.0,
        "largest deceleration that a lane change may cause for the new follower [m/s^2]; "
        f"{_SOURCE}.LANE_CHANGE_MAX_BRAKING_IMPOSED",
    )
    delay: float = key(1.0, f"time between two decisions [s]; {_SOURCE}.LANE_CHANGE_DELAY")

    @property
    def is_default(self) -> bool:
        """True if all values are highway-env's."""
        return self == MobilConfig()

    def check(self) -> None:
        for name, (low, high) in BOUNDS.items():
            if not low <= getattr(self, name) <= high:
                raise out_of_range(name, f"must be within {low:g} and {high:g}", getattr(self, name))

"""Keys of the comparison with highway-env."""

import math
from dataclasses import dataclass, fields

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least, check_within
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class SceneCountsConfig:
    """Scenes of each set; injected: vehicles that this package places, not highway-env"""

    road2: int = key(20, "2 IDM vehicles, placed by highway-env")
    road10: int = key(100, "10 IDM vehicles, placed by highway-env")
    road30: int = key(30, "30 IDM vehicles, placed by highway-env")
    road60: int = key(8, "60 IDM vehicles, placed by highway-env")
    env2: int = key(20, "reset of highway-v0: one vehicle with random meta-actions and 1 IDM vehicle")
    env10: int = key(60, "reset of highway-v0: one vehicle with random meta-actions and 10 IDM vehicles")
    env30: int = key(10, "reset of highway-v0: one vehicle with random meta-actions and 30 IDM vehicles")
    multi10: int = key(80, "reset of highway-v0: 10 vehicles with random meta-actions and 5 IDM vehicles")
    stress2: int = key(20, "injected: 2 IDM vehicles of very different speeds on one or two lanes")
    stress10: int = key(50, "injected: 10 IDM vehicles of very different speeds in random list order; crashes")
    stress30: int = key(20, "injected: 30 IDM vehicles of very different speeds in random list order; crashes")
    stress60: int = key(4, "injected: 60 IDM vehicles of very different speeds in random list order; crashes")
    edge10: int = key(40, "injected: 8 IDM and 2 meta-action vehicles before the start or near the end of the road")
    drivers10: int = key(40, "injected: 10 IDM vehicles that differ in every parameter, in size, heading and timer")

    def check(self) -> None:
        """Raise InvalidInputError if a number is negative or all are zero."""
        names = [field.name for field in fields(self)]
        check_least(self, 0, *names)
        if not any(getattr(self, name) for name in names):
            raise out_of_range(
                names[0],
                "must be > 0, or another number of scenes must be, because otherwise there is nothing to compare",
                0,
            )


@dataclass(unsafe_hash=True)
class ValidationConfig:
    """Comparison of the traffic model with highway-env"""

    scenes: SceneCountsConfig = key(SceneCountsConfig, SceneCountsConfig.__doc__ or "")
    share: float = key(1.0, "share of all numbers of scenes and of the least numbers of events; 0.05 for a quick look")
    seconds: int = key(60, "length of each scene [s]; REARL (Bi et al.)")
    seed: int = key(0, "seed of all scenes")
    workers: int | None = key(None, "processes that run highway-env; null = one per core")
    control_share: float = key(
        0.1, "share of each set that highway-env runs again with NumPy's vector functions, as a control [-]"
    )
    tolerance_f64: float = key(1e-9, "largest difference of a position between the programs in float64 [m]")
    tolerance_f32: float = key(
        2e-3, "largest difference of a position between the programs in float32, before contact [m]"
    )
    least_agree_share: float = key(0.99, "smallest share of scenes that must agree in float64 [-]")
    least_lane_changes: int = key(5000, "smallest number of lane changes in the comparison")
    least_aborts: int = key(300, "smallest number of aborted lane changes")
    least_crashes: int = key(500, "smallest number of crashed vehicles")

    def check(self) -> None:
        if not 0 < self.share <= 1:
            raise out_of_range("share", "must be within 0 (excluded) and 1", self.share)
        check_least(self, 1, "seconds", "workers")
        check_within(self, 0, 1, "control_share", "least_agree_share")
        for name in ("tolerance_f64", "tolerance_f32"):
            if not 0 < getattr(self, name) < math.inf:
                raise out_of_range(name, "must be positive and finite [m]", getattr(self, name))
        check_least(self, 0, "seed", "least_lane_changes", "least_aborts", "least_crashes")

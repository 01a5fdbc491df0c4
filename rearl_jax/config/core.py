"""Keys of the traffic model and of its initial states."""

import math
from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_positive, check_within
from rearl_jax.problems import out_of_range

MOST_LANES = 8
"""Largest number of lanes of a simulated road."""


class Precision(Enum):
    """Floating type of the simulation."""

    float32 = "float32"
    float64 = "float64"


@dataclass(unsafe_hash=True)
class CoreConfig:
    """Road, time step and parts of the simulation."""

    n_lanes: int | None = key(
        None, "number of lanes, 1 to 8; null = those of the recordings with init.source=scene, otherwise 4 (REARL)"
    )
    n_vehicles: int = key(10, "vehicles in each scenario; REARL (Bi et al.)")
    density: float = key(2.0, "density of the initial traffic, vehicles_density of highway-env [-]; REARL (Bi et al.)")
    speed_limit: float | None = key(
        30.0,
        "upper limit of the desired speed [m/s], null = none; at least the highest recorded speed with "
        "init.source=scene; highway-env 1.12.1",
    )
    ticks_per_second: int = key(15, "time steps per second [1/s]; highway-env 1.12.1")
    lane_changes: bool = key(True, "vehicles change lanes (MOBIL)")
    collisions: bool = key(True, "vehicles collide; false = they pass through each other")
    dtype: Precision = key(Precision.float32, "floating-point type of the simulation")
    chunk: int = key(
        512, "scenarios that one core simulates at a time; more need more memory, fewer are slower per scenario"
    )

    @property
    def lanes(self) -> int:
        """Number of lanes; REARL's if neither the key nor a recording states it."""
        return 4 if self.n_lanes is None else self.n_lanes

    def check(self) -> None:
        check_within(self, 1, MOST_LANES, "n_lanes")
        check_least(self, 1, "n_vehicles", "ticks_per_second", "chunk")
        check_positive(self, "density")
        check_finite(self, "density")
        if self.speed_limit is not None and not 0 < self.speed_limit < math.inf:
            raise out_of_range("speed_limit", "must be > 0 m/s, or null for none", self.speed_limit)


class InitialSpeed(Enum):
    """Initial speeds."""

    u21_24 = "u21_24"
    fixed_25 = "fixed_25"


class InitialSource(Enum):
    """Source of initial states."""

    seed = "seed"
    """Drawn as highway-env does, as in the paper."""
    scene = "scene"
    """The first snapshot of the recorded scene."""


@dataclass(unsafe_hash=True)
class InitConfig:
    """Initial states of the rollouts."""

    source: InitialSource = key(
        InitialSource.scene,
        "scene: first snapshot of the recorded scene; seed: drawn as highway-env does (REARL), with speed.norm=minmax",
    )
    speed: InitialSpeed = key(
        InitialSpeed.u21_24,
        "with init.source=seed, u21_24: drawn from 70 to 80 % of the limit; fixed_25: all 25 m/s (controlled vehicles "
        "of highway-env)",
    )

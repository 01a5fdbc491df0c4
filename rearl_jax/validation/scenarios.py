"""The scenes of the comparison, set by set, drawn from one seed.

A scenario contains everything that highway-env needs to build and simulate a scene, so its identity is the hash of its
content. Scene k of a set is the same whatever the number of scenes. NumPy only: worker processes import this without
JAX.
"""

import dataclasses
import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

TICKS_PER_SECOND = 15
"""Simulated ticks per second. Source: highway-env 1.12.1, `AbstractEnv.default_config`, simulation_frequency."""

N_ACTIONS = 5
"""Number of meta-actions. Source: highway-env 1.12.1, `DiscreteMetaAction`."""

HIGHWAY_ENV_LEVELS = (20.0, 25.0, 30.0)
"""Target speeds [m/s]. Source: highway-env 1.12.1, `MDPVehicle.DEFAULT_TARGET_SPEEDS`."""

REARL_LEVELS = tuple(5.0 + 3.375 * level for level in range(9))
"""Target speeds [m/s]. Source: REARL (Bi et al.), as DiLu: nine levels from 5 to 32."""


class Source(Enum):
    """Origin of the vehicles of a scene.

    road: highway-env's `create_random`, on a bare road. env: the reset of `highway-v0`. injected: this module.
    """

    road = "road"
    env = "env"
    injected = "injected"


@dataclass(frozen=True)
class Injection:
    """Vehicles placed by this module, in list order, with the names of `records.Start`. Without a timer, highway-env's
    value is used.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    heading: tuple[float, ...]
    speed: tuple[float, ...]
    desired_speed: tuple[float, ...]
    is_meta: tuple[bool, ...]
    timer: tuple[float, ...] | None = None
    parameters: tuple[tuple[str, tuple[float | bool, ...]], ...] = ()


@dataclass(frozen=True)
class Scenario:
    """One scene, complete.

    Attributes:
        set_name: The set it belongs to.
        index: Number within the set.
        source: Origin of the vehicles.
        seed: Seed of highway-env's generator.
        n_idm: Vehicles driven by IDM and MOBIL.
        n_meta: Vehicles driven by meta-actions.
        speed_levels: Target speeds of the meta-actions [m/s].
        actions: Meta-actions, one row per second, one column per vehicle that follows them, in list order.
        injection: The vehicles, for source=injected.
    """

    set_name: str
    index: int
    source: Source
    seed: int
    n_idm: int
    n_meta: int
    speed_levels: tuple[float, ...]
    actions: tuple[tuple[int, ...], ...]
    injection: Injection | None = None

    @property
    def n_vehicles(self) -> int:
        """Vehicles on the road."""
        return self.n_idm + self.n_meta

    @property
    def n_seconds(self) -> int:
        """Length [s]."""
        return len(self.actions)

    def identity(self) -> str:
        """Twenty hexadecimal digits, equal for scenes that highway-env would build and drive alike."""
        content = dataclasses.asdict(self) | {"source": self.source.value}
        del content["set_name"], content["index"]
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


@dataclass(frozen=True)
class ScenarioSet:
    """Scenes of one kind.

    Attributes:
        name: Name in the configuration.
        size: Size class of the set: 2, 10, 30 or 60; an ego or further vehicles may be added.
        source: Origin of the vehicles.
        n_idm: Vehicles driven by IDM and MOBIL.
        n_meta: Vehicles driven by meta-actions.
        speed_levels: Target speeds of the meta-actions [m/s].
        inject: Function that draws the vehicles of one scene, for source=injected.
        cooperative: Whether some driver's politeness is not zero.
    """

    name: str
    size: int
    source: Source
    n_idm: int
    n_meta: int = 0
    speed_levels: tuple[float, ...] = HIGHWAY_ENV_LEVELS
    inject: Callable[[np.random.Generator, int], Injection] | None = None
    cooperative: bool = False

    @property
    def n_vehicles(self) -> int:
        """Vehicles on the road."""
        return self.n_idm + self.n_meta

    def scenario(self, index: int, *, seed: int, n_seconds: int) -> Scenario:
        """Scene `index` of the set."""
        set_number = [known.name for known in SETS].index(self.name)
        random = np.random.default_rng([seed, set_number, index])
        highway_env_seed = int(random.integers(2**31))
        injection = None if self.inject is None else self.inject(random, index)
        # One row at a time, so that a longer scene begins like a shorter one.
        actions = [random.integers(0, N_ACTIONS, self.n_meta).tolist() for _ in range(n_seconds)]
        return Scenario(
            set_name=self.name,
            index=index,
            source=self.source,
            seed=highway_env_seed,
            n_idm=self.n_idm,
            n_meta=self.n_meta,
            speed_levels=self.speed_levels,
            actions=tuple(map(tuple, actions)),
            injection=injection,
        )


def _positions(random: np.random.Generator, n_vehicles: int, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] along and across the road, each vehicle ahead of all before it.

    Source: highway-env 1.12.1, `Vehicle.create_random`, at vehicles_density 2 on four lanes.
    """
    lane = random.integers(0, 4, n_vehicles)
    offset = 0.5 * (12 + speed) * np.exp(-5 / 40 * 4)
    x = np.cumsum(offset * random.uniform(0.9, 1.1, n_vehicles)) + 3 * offset[0]
    return x, 4.0 * lane


def _injection(random: np.random.Generator, *, shuffled: bool = False, **columns: np.ndarray) -> Injection:
    """The vehicles as plain numbers, in random list order if `shuffled`."""
    n_vehicles = len(columns["x"])
    order = random.permutation(n_vehicles) if shuffled else np.arange(n_vehicles)
    columns = {"heading": np.zeros(n_vehicles), "is_meta": np.zeros(n_vehicles, bool)} | columns
    return Injection(**{name: tuple(values[order].tolist()) for name, values in columns.items()})


def _stress(n_vehicles: int) -> Callable[[np.random.Generator, int], Injection]:
    """Vehicles of very different speeds, close together and in random list order, so that aborts chain and many
    crash.
    """

    def draw(random: np.random.Generator, index: int) -> Injection:
        speed = random.uniform(10, 32, n_vehicles)
        x, y = _positions(random, n_vehicles, random.uniform(21, 24, n_vehicles))
        if n_vehicles == 2:
            y = y * (index % 2)  # every other scene on one lane, so that its two vehicles always meet
        desired = random.uniform(10, 34, n_vehicles)
        return _injection(random, shuffled=True, x=x, y=y, speed=speed, desired_speed=desired)

    return draw


def _edge(random: np.random.Generator, index: int) -> Injection:
    """Ten vehicles that start before the beginning of the road, or about its end; every fifth follows meta-actions."""
    n_vehicles = 10
    speed = random.uniform(18, 28, n_vehicles)
    x, y = _positions(random, n_vehicles, speed)
    if index % 2:
        x = x - x[-1] + random.uniform(9_000, 10_020)
    else:
        x = x - x[0] - random.uniform(5, 300)
    desired = random.uniform(15, 32, n_vehicles)
    is_meta = np.arange(n_vehicles) % 5 == 2
    return _injection(random, shuffled=True, x=x, y=y, speed=speed, desired_speed=desired, is_meta=is_meta)


_PARAMETER_RANGES = {
    "max_accel": (1.0, 4.0),
    "comfort_decel": (2.0, 6.0),
    "jam_spacing": (7.0, 15.0),
    "time_gap": (0.8, 2.5),
    "accel_exponent": (2.0, 6.0),
    "accel_limit": (4.0, 9.0),
    "politeness": (0.0, 1.0),
    "gain_threshold": (0.05, 0.5),
    "safe_decel": (1.0, 4.0),
    "length": (3.5, 16.0),
    "width": (1.7, 2.6),
}
"""Ranges of the parameters in the set `drivers10`, wide about highway-env's defaults. Units as in `records.Start`."""


def _drivers(random: np.random.Generator, index: int) -> Injection:
    """Ten vehicles that differ in everything a vehicle can differ in; some never change lanes or look for
    collisions.
    """
    n_vehicles = 10
    drawn: dict[str, np.ndarray] = {
        name: random.uniform(*limits, n_vehicles) for name, limits in _PARAMETER_RANGES.items()
    }
    drawn["changes_lanes"] = random.uniform(size=n_vehicles) < 0.9
    drawn["collides"] = random.uniform(size=n_vehicles) < 0.8
    columns = {
        "x": np.cumsum(random.uniform(9, 22, n_vehicles)) + random.uniform(0, 300),
        "y": 4.0 * random.integers(0, 4, n_vehicles) + random.uniform(-1.5, 1.5, n_vehicles),
        "heading": random.uniform(-0.05, 0.05, n_vehicles),
        "speed": random.uniform(12, 30, n_vehicles),
        "desired_speed": random.uniform(12, 34, n_vehicles),
        "timer": random.uniform(0.001, 1.2, n_vehicles),
    }
    order = random.permutation(n_vehicles)
    placed = _injection(random, shuffled=False, **{name: values[order] for name, values in columns.items()})
    parameters = tuple((name, tuple(values.tolist())) for name, values in drawn.items())
    return dataclasses.replace(placed, parameters=parameters)


SETS = (
    ScenarioSet("road2", 2, Source.road, n_idm=2),
    ScenarioSet("road10", 10, Source.road, n_idm=10),
    ScenarioSet("road30", 30, Source.road, n_idm=30),
    ScenarioSet("road60", 60, Source.road, n_idm=60),
    ScenarioSet("env2", 2, Source.env, n_idm=1, n_meta=1),
    ScenarioSet("env10", 10, Source.env, n_idm=10, n_meta=1),
    ScenarioSet("env30", 30, Source.env, n_idm=30, n_meta=1, speed_levels=REARL_LEVELS),
    ScenarioSet("multi10", 10, Source.env, n_idm=5, n_meta=10),
    ScenarioSet("stress2", 2, Source.injected, n_idm=2, inject=_stress(2)),
    ScenarioSet("stress10", 10, Source.injected, n_idm=10, inject=_stress(10)),
    ScenarioSet("stress30", 30, Source.injected, n_idm=30, inject=_stress(30)),
    ScenarioSet("stress60", 60, Source.injected, n_idm=60, inject=_stress(60)),
    ScenarioSet("edge10", 10, Source.injected, n_idm=8, n_meta=2, speed_levels=REARL_LEVELS, inject=_edge),
    ScenarioSet("drivers10", 10, Source.injected, n_idm=10, inject=_drivers, cooperative=True),
)
"""All sets, in the order in which they are reported."""

SIZES = (2, 10, 30, 60)
"""Size classes of the report."""

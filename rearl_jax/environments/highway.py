"""The highway as a decision process: one vehicle takes a meta-action every second, the others drive by IDM and MOBIL.

Scenarios in lockstep, the scenario axis last as in the core; the controlled vehicle ("ego") is vehicle 0. The traffic,
observation, reward and the end of an episode are those of highway-env's `highway-v0`.

Source: highway-env 1.12.1, `HighwayEnv` and `AbstractEnv.step`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int, Key

from rearl_jax.core.boundary import BoundarySecond
from rearl_jax.core.drivers import Drivers, highway_env_drivers
from rearl_jax.core.meta_actions import MetaAction, apply_meta_actions
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.rollout import simulate_second, simulate_watched_second
from rearl_jax.core.spawn import EXPONENT_RANGE, spawn
from rearl_jax.core.state import Controller, TrafficState, nearest_level
from rearl_jax.decision.observation import COLUMNS, N_ROWS, ObservationSpec, highway_env_observation, observe_neighbours
from rearl_jax.decision.reward import reward
from rearl_jax.environments.surroundings import Surroundings, touches
from rearl_jax.problems import out_of_range

EGO = 0
"""The controlled vehicle."""

EGO_SPEED = 25.0
"""Initial speed of the controlled vehicle [m/s]. Source: highway-env 1.12.1, `HighwayEnv._create_vehicles`."""

PRECISIONS = ("float32", "float64")


@dataclass(frozen=True)
class HighwayOptions:
    """Options of the environment that change the compiled program.

    Attributes:
        n_lanes: Lanes of the road, 1 to 8; None for 4 or, with measured scenes, as many as the scenes need.
        n_others: Vehicles besides the controlled one; measured scenes bring their own number.
        density: highway-env's `vehicles_density` [-].
        duration: Seconds until an episode is truncated [s].
        speed_levels: Target speeds [m/s] that FASTER and SLOWER choose from.
        ticks_per_second: Simulation ticks per second [1/s].
        n_rows: Vehicles in an observation, the controlled one first.
        see_behind: Whether vehicles more than 10 m behind are seen.
        dtype: Floating type of the simulation, float32 or float64; the latter needs JAX's x64 mode.

    Source: highway-env 1.12.1, `HighwayEnv.default_config`, `MDPVehicle.DEFAULT_TARGET_SPEEDS`.
    """

    n_lanes: int | None = None
    n_others: int = 50
    density: float = 1.0
    duration: int = 40
    speed_levels: Sequence[float] = (20.0, 25.0, 30.0)
    ticks_per_second: int = 15
    n_rows: int = N_ROWS
    see_behind: bool = False
    dtype: str = "float32"

    def __post_init__(self) -> None:
        # A list, as from JSON, would not be hashable.
        object.__setattr__(self, "speed_levels", tuple(self.speed_levels))
        for name, least in (("n_others", 0), ("duration", 1), ("n_rows", 1)):
            if getattr(self, name) < least:
                raise out_of_range(name, f"must be at least {least}", getattr(self, name))
        if not 0 < self.density < np.inf:
            raise out_of_range("density", "must be greater than 0 and finite (highway-env: 1)", self.density)
        if self.dtype not in PRECISIONS:
            raise out_of_range("dtype", f"must be one of {', '.join(PRECISIONS)}", self.dtype)
        if self.dtype == "float64" and not jax.config.read("jax_enable_x64"):
            raise out_of_range("dtype", 'needs jax.config.update("jax_enable_x64", True) first', self.dtype)
        _ = self.model  # checks the remaining options

    @cached_property
    def model(self) -> TrafficModel:
        """The road."""
        return TrafficModel(
            n_lanes=4 if self.n_lanes is None else self.n_lanes,
            speed_levels=tuple(self.speed_levels),
            ticks_per_second=self.ticks_per_second,
        )

    @cached_property
    def observation(self) -> ObservationSpec:
        """Observation of the controlled vehicle: highway-env's `Kinematics`."""
        return highway_env_observation(self.model.n_lanes, self.n_rows, see_behind=self.see_behind)

    @property
    def observation_shape(self) -> tuple[int, int]:
        """Rows and columns of an observation."""
        return self.n_rows, len(COLUMNS)


class Start(eqx.Module):
    """Measured vehicles that episodes begin with.

    Attributes:
        traffic: The vehicles, the controlled one first.
        case: Index of each scenario's case in the `Surroundings`; None on a free road.
        replayed: Recorded vehicles around the measured ones; None on a free road.
    """

    traffic: TrafficState
    case: Int[Array, "*scenarios"] | None = None
    replayed: ReplayedVehicles | None = None


class Starts(eqx.Module):
    """Measured vehicles to begin with, of all cases.

    Attributes:
        state: The vehicles of each case, the controlled one first, the last axis over cases.
        around: Recorded traffic around the vehicles; None for a free road.
    """

    state: TrafficState
    around: Surroundings | None = None

    @property
    def n_cases(self) -> int:
        """Number of cases."""
        return self.state.x.shape[-1]

    def start(self, case: Int[Array, "*scenarios"]) -> Start:
        """The cases with these indices."""
        traffic = jax.tree.map(lambda leaf: leaf[..., case], self.state)
        return Start(traffic) if self.around is None else Start(traffic, case, self.around.at_start(case))


class HighwayState(eqx.Module):
    """Scenarios between two decisions.

    Attributes:
        traffic: The vehicles, the controlled one first.
        drivers: Parameters of the other vehicles' drivers.
        time: Seconds since the episode began [s].
        case: Index of each scenario's case in the `Surroundings`; None on a free road.
        replayed: Recorded vehicles around the simulated ones at this moment; None on a free road.
    """

    traffic: TrafficState
    drivers: Drivers
    time: Int[Array, "*scenarios"]
    case: Int[Array, "*scenarios"] | None = None
    replayed: ReplayedVehicles | None = None


class Outcome(eqx.Module):
    """Result of a decision.

    Attributes:
        observation: Observation after the second: presence, x, y, vx, vy of each vehicle, see `ObservationSpec`.
        reward: Reward for the second, within [0, 1], see `decision.reward`.
        terminated: Whether the controlled vehicle has crashed.
        truncated: Whether the episode has lasted its full duration; an episode may be both terminated and truncated.
        speed: Speed of the controlled vehicle [m/s].
    """

    observation: Float[Array, "rows columns *scenarios"]
    reward: Float[Array, "*scenarios"]
    terminated: Bool[Array, "*scenarios"]
    truncated: Bool[Array, "*scenarios"]
    speed: Float[Array, "*scenarios"]


def begin(keys: Key[Array, " scenarios"], options: HighwayOptions, measured: Start | None = None) -> HighwayState:
    """The first state of an episode for each key.

    Traffic is drawn by `core.spawn`; the controlled vehicle, the rearmost, begins at `EGO_SPEED`. That is highway-env's
    traffic except for its position along the road of 10 km: highway-env's `ego_spacing` shifts all vehicles alike.

    Args:
        keys: Random keys.
        options: The environment.
        measured: Vehicles to begin with instead of drawn ones; their drivers are drawn.
    """
    dtype = jnp.dtype(options.dtype)
    if measured is None:
        traffic, drivers = spawn(
            keys, options.model, n_vehicles=options.n_others + 1, density=options.density, dtype=dtype
        )
        level = int(nearest_level(np.array([EGO_SPEED]), options.model)[0])
        traffic = replace(
            traffic,
            speed=traffic.speed.at[EGO].set(EGO_SPEED),
            desired_speed=traffic.desired_speed.at[EGO].set(options.speed_levels[level]),
            controller=traffic.controller.at[EGO].set(int(Controller.META)),
        )
        measured = Start(traffic)
    else:
        traffic, n_vehicles = measured.traffic, measured.traffic.x.shape[0]
        draw = jax.vmap(lambda key: jax.random.uniform(key, (n_vehicles,), dtype, *EXPONENT_RANGE), out_axes=-1)
        drivers = highway_env_drivers(draw(keys), ticks_per_second=options.ticks_per_second)
    return HighwayState(traffic, drivers, jnp.zeros(keys.shape, jnp.int32), measured.case, measured.replayed)


def advance(
    state: HighwayState,
    action: Int[Array, " scenarios"],
    options: HighwayOptions,
    boundary_second: BoundarySecond | None = None,
) -> HighwayState:
    """The state one second later, after the controlled vehicle has followed an action, see `MetaAction`.

    The controlled vehicle has also crashed if it touched a recorded vehicle at the beginning of a time step or at the
    end of the second.

    Args:
        state: The scenarios.
        action: Action of the controlled vehicle.
        options: The environment.
        boundary_second: Recorded traffic around the vehicles in this second; None on a free road.
    """
    is_ego = lax.broadcasted_iota(jnp.int32, state.traffic.x.shape, 0) == EGO
    actions = jnp.where(is_ego, action.astype(jnp.int32)[None], int(MetaAction.IDLE))
    traffic = apply_meta_actions(state.traffic, actions, options.model)
    drivers, time = state.drivers, state.time + 1
    if boundary_second is None:
        return HighwayState(simulate_second(traffic, drivers, options.model), drivers, time)

    def is_hit(traffic: TrafficState, replayed: ReplayedVehicles) -> Bool[Array, " scenarios"]:
        return touches(traffic, EGO, drivers.body, replayed, options.model)

    traffic, hits = simulate_watched_second(traffic, drivers, options.model, boundary_second, is_hit)
    has_crashed = traffic.crashed[EGO] | hits.any(axis=0) | is_hit(traffic, boundary_second.after)
    traffic = replace(traffic, crashed=traffic.crashed.at[EGO].set(has_crashed))
    return HighwayState(traffic, drivers, time, state.case, boundary_second.after)


def surroundings_now(state: HighwayState, around: Surroundings | None) -> BoundarySecond | None:
    """Recorded traffic around the vehicles in the second that begins; None on a free road."""
    return None if around is None or state.case is None else around.second(state.case, state.time)


def observe(state: HighwayState, options: HighwayOptions) -> Float[Array, "rows columns scenarios"]:
    """Observation of the controlled vehicle."""
    features = observe_neighbours(state.traffic, options.observation, slice(EGO, EGO + 1), state.replayed)
    return features.reshape(*options.observation_shape, -1)


def outcome_of(
    state: HighwayState, options: HighwayOptions, duration: Int[Array, ""] | Int[Array, " scenarios"] | int
) -> Outcome:
    """Outcome of the decision that led to a state, the end of the episode included.

    Args:
        state: The scenarios.
        options: The environment.
        duration: Seconds until an episode is truncated [s].
    """
    return Outcome(
        observation=observe(state, options),
        reward=reward(state.traffic, options.model)[EGO].astype(jnp.float32),
        terminated=state.traffic.crashed[EGO],
        truncated=state.time >= duration,
        speed=state.traffic.speed[EGO].astype(jnp.float32),
    )


def select(is_first: Bool[Array, " scenarios"], first: HighwayState, second: HighwayState) -> HighwayState:
    """The first state where `is_first`, else the second; arrays without a scenario axis are those of the second."""
    n_scenarios = is_first.shape[0]

    def choose(a: Array, b: Array) -> Array:
        return jnp.where(is_first.reshape(*(1,) * (a.ndim - 1), -1), a, b) if a.shape[-1] == n_scenarios else b

    return jax.tree.map(choose, first, second)

"""The highway with the interface of gymnax: pure functions of an explicit state and key, for `jax.jit` and `jax.vmap`.

gymnax is needed for the spaces only, which are classes of gymnax (`pip install 'rearl_jax[gymnax]'`).

Source: gymnax 1.0, `environments.environment.Environment`.
"""

from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Key, UInt32

from rearl_jax._typing import PRNGKey
from rearl_jax.core.boundary import BoundarySecond
from rearl_jax.core.compaction import if_any
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.decision.situation import N_ACTIONS
from rearl_jax.environments import highway
from rearl_jax.environments.batching import in_lockstep
from rearl_jax.environments.highway import HighwayState, Outcome, Start, Starts
from rearl_jax.environments.starts import Recorded, options_of, with_scenes
from rearl_jax.environments.surroundings import Surroundings

AnyKey: TypeAlias = PRNGKey | UInt32[Array, "2"]
"""A random key of either kind."""


class HighwayParams(eqx.Module):
    """Parameters that may change between calls without a new compilation.

    Attributes:
        max_steps_in_episode: Seconds until an episode is truncated [s]; among recorded vehicles at most as many as were
            recorded.
        starts: Measured vehicles to begin with, one case drawn for each episode; None to draw the traffic.
    """

    max_steps_in_episode: Int[Array, ""] | int = 40
    starts: Starts | None = None

    @property
    def duration(self) -> Int[Array, ""]:
        """Seconds until an episode is truncated [s].

        Raises:
            ValueError: It is not a single whole number.
        """
        duration = _whole("max_steps_in_episode", self.max_steps_in_episode)
        return duration if self.around is None else jnp.minimum(duration, self.around.n_seconds)

    @property
    def around(self) -> Surroundings | None:
        """Recorded traffic around the cases; None for a free road."""
        return None if self.starts is None else self.starts.around

    def replace(self, **changes: Any) -> "HighwayParams":
        """A copy with other values."""
        return replace(self, **changes)


class FunctionalHighway:
    """One controlled vehicle on a highway, one scenario at a time.

    Under `jax.vmap` all scenarios run in lockstep, with the scenario axis last internally:

        env = FunctionalHighway(n_others=20)
        keys = jax.random.split(jax.random.key(0), 1024)
        observation, state = jax.vmap(env.reset)(keys)
        observation, state, reward, terminated, truncated, info = jax.vmap(env.step)(keys, state, actions)

    Actions are those of `MetaAction`; observation, reward, termination and truncation those of `highway.Outcome`. When
    an episode ends, `step` starts a new one: the observation is the first of the new episode, and
    `info["final_observation"]` the last of the old one.
    """

    def __init__(
        self, scenes: SceneSet | None = None, boundary: str = "free", data: Recorded = None, **options: Any
    ) -> None:
        """Prepares the environment; nothing is compiled before the first call.

        Args:
            scenes: Measured scenes to begin with, each vehicle of each in the place of the controlled one; None to draw
                the traffic.
            boundary: Recorded vehicles replayed around the simulated ones, as in `with_scenes`.
            data: Recordings of the scenes, as in `with_scenes`.
            **options: Fields of `HighwayOptions`.

        Raises:
            ValueError: An option is unknown or outside its range, or the scenes do not fit the road or the
                boundary.
        """
        self.options, self._starts = with_scenes(options_of(options), scenes, boundary, data)

    @property
    def name(self) -> str:
        """Name of the environment, as in gymnax."""
        return "Highway-rearl_jax"

    @property
    def num_actions(self) -> int:
        """Number of actions."""
        return N_ACTIONS

    @property
    def default_params(self) -> HighwayParams:
        """The duration of the options, and the measured scenes."""
        return HighwayParams(self.options.duration, self._starts)

    @partial(jax.jit, static_argnames="self")
    def reset(
        self, key: AnyKey, params: HighwayParams | None = None
    ) -> tuple[Float[Array, "rows columns"], HighwayState]:
        """Observation and state at the beginning of an episode."""
        return self.reset_env(key, self.default_params if params is None else params)

    @partial(jax.jit, static_argnames="self")
    def step(
        self,
        key: AnyKey,
        state: HighwayState,
        action: Int[Array, ""] | int,
        params: HighwayParams | None = None,
    ) -> tuple[Float[Array, "rows columns"], HighwayState, Float[Array, ""], Bool[Array, ""], Bool[Array, ""], dict]:
        """Observation, state, reward, whether the episode has terminated, whether it was truncated, and info.

        Args:
            key: Random key of the next episode, if the present one ends.
            state: The scenario.
            action: Action of the controlled vehicle, see `MetaAction`; a number that is none is IDLE.
            params: As in `default_params`.

        Raises:
            ValueError: The action is not a single whole number.
        """
        params = self.default_params if params is None else params
        after, outcome = self._second(state, action, params)
        case_key, traffic_key = jax.random.split(_typed(key))
        observation, after = in_lockstep(self._renewed)(
            outcome.terminated | outcome.truncated,
            traffic_key,
            after,
            outcome.observation,
            _drawn_start(case_key, params),
        )
        info = {
            "terminated": outcome.terminated,
            "truncated": outcome.truncated,
            "final_observation": outcome.observation,
            "speed": outcome.speed,
        }
        return observation, after, outcome.reward, outcome.terminated, outcome.truncated, info

    def reset_env(self, key: AnyKey, params: HighwayParams) -> tuple[Float[Array, "rows columns"], HighwayState]:
        """Same as `reset`, without `jax.jit`."""

        def start(key: Array, measured: Start | None) -> tuple[Array, HighwayState]:
            state = highway.begin(key, self.options, measured)
            return highway.observe(state, self.options), state

        case_key, traffic_key = jax.random.split(_typed(key))
        return in_lockstep(start)(traffic_key, _drawn_start(case_key, params))

    def step_env(
        self, key: AnyKey, state: HighwayState, action: Int[Array, ""] | int, params: HighwayParams
    ) -> tuple[Float[Array, "rows columns"], HighwayState, Float[Array, ""], Bool[Array, ""], dict]:
        """Same as `step`, without `jax.jit`, truncation and the start of new episodes."""
        after, outcome = self._second(state, action, params)
        return outcome.observation, after, outcome.reward, outcome.terminated, {"speed": outcome.speed}

    def get_obs(
        self, state: HighwayState, params: HighwayParams | None = None, key: AnyKey | None = None
    ) -> Float[Array, "rows columns"]:
        """Observation of the controlled vehicle; the same for any params and key."""
        return in_lockstep(partial(highway.observe, options=self.options))(state)

    def observe(
        self, key: AnyKey, state: HighwayState, action: Int[Array, ""] | int | None, params: HighwayParams
    ) -> Float[Array, "rows columns"]:
        """Same as `get_obs`, with arguments in the order of gymnax."""
        return self.get_obs(state, params, key)

    def is_terminated(self, state: HighwayState, params: HighwayParams) -> Bool[Array, ""]:
        """True if the controlled vehicle has crashed."""
        return state.traffic.crashed[highway.EGO]

    def is_truncated(self, state: HighwayState, params: HighwayParams) -> Bool[Array, ""]:
        """True if the episode has lasted its full duration."""
        return state.time >= params.duration

    def action_space(self, params: HighwayParams | None = None) -> Any:
        """gymnax's space of the actions."""
        return _spaces().Discrete(N_ACTIONS)

    def observation_space(self, params: HighwayParams | None = None) -> Any:
        """gymnax's space of the observations."""
        return _spaces().Box(-1.0, 1.0, self.options.observation_shape, jnp.float32)

    def _second(
        self, state: HighwayState, action: Int[Array, ""] | int, params: HighwayParams
    ) -> tuple[HighwayState, Outcome]:
        """The state a second later, and the outcome of the action."""

        def second(
            state: HighwayState, action: Array, duration: Array, boundary_second: BoundarySecond | None
        ) -> tuple[HighwayState, Outcome]:
            after = highway.advance(state, action, self.options, boundary_second)
            return after, highway.outcome_of(after, self.options, duration)

        boundary_second = highway.surroundings_now(state, params.around)
        return in_lockstep(second)(state, _whole("action", action), params.duration, boundary_second)

    def _renewed(
        self,
        ended: Bool[Array, " scenarios"],
        keys: Key[Array, " scenarios"],
        state: HighwayState,
        observation: Float[Array, "rows columns scenarios"],
        measured: Start | None,
    ) -> tuple[Float[Array, "rows columns scenarios"], HighwayState]:
        """Observation and state, of the next episode in scenarios whose episode has ended."""

        def begin() -> tuple[Array, HighwayState]:
            new = highway.select(ended, highway.begin(keys, self.options, measured), state)
            return highway.observe(new, self.options), new

        return if_any(ended, begin, (observation, state))


def _whole(name: str, value: Any) -> Int[Array, ""]:
    """A single whole number; ValueError for an array or another type, which a conversion would change in silence."""
    number = jnp.asarray(value)
    if number.shape or not jnp.issubdtype(number.dtype, jnp.integer):
        raise ValueError(f"{name} must be a whole number, got {number.dtype}{list(number.shape) or ''}")
    return number.astype(jnp.int32)


def _drawn_start(key: PRNGKey, params: HighwayParams) -> Start | None:
    """A measured case, drawn at random; None if the traffic is drawn."""
    if params.starts is None:
        return None
    return params.starts.start(jax.random.randint(key, (), 0, params.starts.n_cases))


def _spaces() -> Any:
    try:
        return import_module("gymnax.environments.spaces")
    except ImportError as error:
        raise ImportError(
            "the spaces of the functional environment are gymnax's: pip install 'rearl_jax[gymnax]'; without it: there "
            f"are {N_ACTIONS} actions, and observations are within -1 and 1"
        ) from error


def _typed(key: AnyKey) -> PRNGKey:
    """A key of `jax.random.key`, also from one of `jax.random.PRNGKey`."""
    return key if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else jax.random.wrap_key_data(key)

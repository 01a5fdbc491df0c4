"""The highway as a Gymnasium environment."""

from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float, UInt8

from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.decision.situation import N_ACTIONS
from rearl_jax.environments import rendering
from rearl_jax.environments.arguments import check_reset_options, seed_of, whole_numbers
from rearl_jax.environments.highway import HighwayOptions
from rearl_jax.environments.programs import Scenarios, keys_of, restart_program, start_program, step_program
from rearl_jax.environments.starts import OF_GYMNASIUM, Recorded, options_of, with_scenes


class HighwayEnv(gymnasium.Env[np.ndarray, np.int64]):
    """One controlled vehicle on a highway.

    Actions: `MetaAction`, one a second. Observation: rows of presence, x, y, vx, vy of the controlled vehicle and of
        the nearest others, see `decision.observation`. Reward: within [0, 1], see `decision.reward`. Terminated: the
        controlled vehicle has crashed. Truncated: the episode has lasted `duration` seconds. All are the same as in
        highway-env's `highway-v0`.

    `info` contains `speed` [m/s] and `crashed` of the controlled vehicle. With `render_mode="rgb_array"`, `render`
    returns a picture of the road around this vehicle, see `rendering`.
    """

    metadata = rendering.metadata()

    def __init__(
        self,
        scenes: SceneSet | None = None,
        render_mode: str | None = None,
        boundary: str = "free",
        data: Recorded = None,
        **options: Any,
    ) -> None:
        """Prepares the environment; nothing is compiled before the first reset.

        Args:
            scenes: Measured scenes as initial states, each once with every vehicle as the controlled one; None for
                random traffic.
            render_mode: `rgb_array` for pictures, None for none.
            boundary: Recorded vehicles replayed around the simulated ones, as in `with_scenes`.
            data: Recordings of the scenes, as in `with_scenes`.
            **options: Fields of `HighwayOptions`.

        Raises:
            ValueError: An option is unknown or outside its range, or the scenes do not fit the road or the
                boundary.
        """
        self.render_mode = rendering.check_render_mode(render_mode)
        self.options, self._starts = with_scenes(options_of(options, OF_GYMNASIUM), scenes, boundary, data)
        self._around = None if self._starts is None else self._starts.around
        self.observation_space, self.action_space = spaces(self.options)
        self._scenarios: Scenarios | None = None

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Float[np.ndarray, "rows columns"], dict[str, Any]]:
        """Observation and info at the beginning of an episode.

        Args:
            seed: Seed of this and all later episodes, a whole number of any library; None to continue the present
                sequence of episodes.
            options: There are none.

        Raises:
            ValueError: An option is given, or the seed is no whole number from 0.
        """
        check_reset_options(options)
        seed = seed_of(seed)
        super().reset(seed=seed)
        if seed is None and self._scenarios is not None:
            program = restart_program(self.options)
            self._scenarios, start = program(self._scenarios, self._starts, np.ones(1, bool))
        else:
            first_seed = int(self.np_random.integers(2**31)) if seed is None else seed
            self._scenarios, start = start_program(self.options)(keys_of([first_seed]), self._starts)
        info = {"speed": float(start.speed[0]), "crashed": False}
        return np.array(start.observation)[..., 0], info

    def step(self, action: Any) -> tuple[Float[np.ndarray, "rows columns"], float, bool, bool, dict[str, Any]]:
        """Observation, reward, whether the episode has terminated, whether it was truncated, and info.

        Args:
            action: A `MetaAction` or its number, as a Python, NumPy or JAX scalar or an array of size 1.

        Raises:
            RuntimeError: There was no reset.
            ValueError: The action is not a `MetaAction`.
        """
        if self._scenarios is None:
            raise RuntimeError("there is no episode yet: call reset() before step()")
        number = whole_numbers(action)
        if number is None or number.size != 1 or not self.action_space.contains(number.reshape(())):
            raise ValueError(f"action {action!r} is none of 0 to {N_ACTIONS - 1}: see rearl_jax.MetaAction")
        self._scenarios, outcome = step_program(self.options)(
            self._scenarios, self._around, number.reshape(1).astype(np.int32)
        )
        terminated = bool(outcome.terminated[0])
        info = {"speed": float(outcome.speed[0]), "crashed": terminated}
        observation = np.array(outcome.observation)[..., 0]
        return observation, float(outcome.reward[0]), terminated, bool(outcome.truncated[0]), info

    def render(self) -> UInt8[np.ndarray, "height width 3"] | None:  # type: ignore[override]
        """A picture of the present second with `render_mode="rgb_array"`, else None.

        Raises:
            RuntimeError: There was no reset.
        """
        if self.render_mode is None:
            return None
        if self._scenarios is None:
            raise RuntimeError("there is no episode yet: call reset() before render()")
        return rendering.pictures(self._scenarios.state, self.options)[0]


def spaces(options: HighwayOptions) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Discrete]:
    """Spaces of the observations and of the actions of one scenario."""
    return (
        gymnasium.spaces.Box(-1.0, 1.0, options.observation_shape, np.float32),
        gymnasium.spaces.Discrete(N_ACTIONS),
    )

"""The highway as a Gymnasium vector environment: many scenarios in lockstep in one compiled program."""

from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool, Float, UInt8

from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.decision.situation import N_ACTIONS
from rearl_jax.environments import rendering
from rearl_jax.environments.arguments import check_reset_options, number_of_scenarios, seed_of, whole_numbers
from rearl_jax.environments.programs import (
    FirstObservation,
    Scenarios,
    keys_of,
    restart_program,
    start_program,
    step_program,
)
from rearl_jax.environments.single import spaces
from rearl_jax.environments.starts import OF_GYMNASIUM, Recorded, options_of, with_scenes
from rearl_jax.problems import out_of_range


class HighwayVectorEnv(gymnasium.vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Scenarios with a controlled vehicle each; the description of `HighwayEnv` applies to each.

    Seeded with s, scenario i has the episodes of a `HighwayEnv` seeded with s + i, as in Gymnasium's `SyncVectorEnv`. A
    finished scenario restarts according to `autoreset_mode`: in the next step, whose action is ignored and whose reward
    is 0; in the same step, with `final_obs` and `final_info` in the info; or (disabled) only by
    `reset(options={"reset_mask": ...})`.

    Source of the modes: Gymnasium 1.4, `SyncVectorEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenes: SceneSet | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        boundary: str = "free",
        data: Recorded = None,
        **options: Any,
    ) -> None:
        """Prepares the environment; nothing is compiled before the first reset.

        Args:
            num_envs: Number of scenarios.
            scenes: Measured scenes as initial states, each once with every vehicle as the controlled one; None for
                random traffic.
            autoreset_mode: Treatment of finished episodes.
            render_mode: `rgb_array` for pictures, None for none.
            boundary: Recorded vehicles replayed around the simulated ones, as in `with_scenes`.
            data: Recordings of the scenes, as in `with_scenes`.
            **options: Fields of `HighwayOptions`.

        Raises:
            ValueError: An option is unknown or outside its range, or the scenes do not fit the road or the
                boundary.
        """
        self.num_envs = num_envs = number_of_scenarios(num_envs)
        self.options, self._starts = with_scenes(options_of(options, OF_GYMNASIUM), scenes, boundary, data)
        self._around = None if self._starts is None else self._starts.around
        if autoreset_mode not in [*AutoresetMode, *(values := [mode.value for mode in AutoresetMode])]:
            raise out_of_range("autoreset_mode", f"must be one of {', '.join(values)}", repr(autoreset_mode))
        self._mode = AutoresetMode(autoreset_mode)
        self.render_mode = rendering.check_render_mode(render_mode)
        self.metadata = rendering.metadata(autoreset_mode=self._mode)
        self.single_observation_space, self.single_action_space = spaces(self.options)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._scenarios: Scenarios | None = None
        self._has_ended = np.zeros(num_envs, bool)

    def reset(
        self,
        *,
        seed: Any = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Float[np.ndarray, "scenarios rows columns"], dict[str, Any]]:
        """Observations and info at the beginning of episodes.

        Args:
            seed: An integer s for the seeds s, s + 1, ...; a sequence of one seed per scenario, None in it to continue
                the present sequence of episodes; None to continue in all scenarios.
            options: `reset_mask`, the scenarios that restart; all by default.

        Raises:
            ValueError: There are too few seeds, a seed is no whole number from 0, an option is unknown, or the mask is
                not a mask of the scenarios.
        """
        seeds = self._seeds(seed)
        super().reset(seed=None if seed is None or np.ndim(seed) else seeds[0])
        begins = self._mask(options)
        if self._scenarios is None:
            drawn = self.np_random.integers(2**31, size=self.num_envs)
            keys = keys_of([int(new) if given is None else given for new, given in zip(drawn, seeds, strict=True)])
            self._scenarios, start = start_program(self.options)(keys, self._starts)
        else:
            is_given = np.array([given is not None for given in seeds]) & begins
            if is_given.any():
                keys = keys_of([0 if given is None else given for given in seeds])
                keys = jax.numpy.where(is_given, keys, self._scenarios.keys)
                self._scenarios = Scenarios(keys, self._scenarios.state)
            start = self._restart(begins)
        self._has_ended = self._has_ended & ~begins
        return _scenarios_first(start.observation), _info(
            np.asarray(start.speed), np.zeros(self.num_envs, bool), begins
        )

    def step(
        self, actions: np.ndarray
    ) -> tuple[
        Float[np.ndarray, "scenarios rows columns"],
        Float[np.ndarray, " scenarios"],
        Bool[np.ndarray, " scenarios"],
        Bool[np.ndarray, " scenarios"],
        dict[str, Any],
    ]:
        """Observations, rewards, masks of terminated and of truncated scenarios, and info.

        Raises:
            RuntimeError: There was no reset, or, without automatic resets, a finished scenario was not reset.
            ValueError: Actions are missing or are not a `MetaAction`.
        """
        if self._scenarios is None:
            raise RuntimeError("there are no episodes yet: call reset() before step()")
        numbers = whole_numbers(actions)
        if numbers is None or not self.action_space.contains(numbers):
            raise ValueError(
                f"actions must be {self.num_envs} whole numbers from 0 to {N_ACTIONS - 1}, see rearl_jax.MetaAction; "
                f"got {actions!r}"
            )
        ended_before = self._has_ended
        if self._mode is AutoresetMode.DISABLED and ended_before.any():
            raise RuntimeError(
                f"{ended_before.sum()} episodes have ended: call reset with options={{'reset_mask': their mask}}"
            )
        self._scenarios, outcome = step_program(self.options)(self._scenarios, self._around, numbers.astype(np.int32))
        observation, speed = _scenarios_first(outcome.observation), np.asarray(outcome.speed)
        reward = np.asarray(outcome.reward, np.float64)
        terminated, truncated = np.array(outcome.terminated), np.array(outcome.truncated)
        all_scenarios, final = np.ones(self.num_envs, bool), {}
        if self._mode is AutoresetMode.NEXT_STEP and ended_before.any():
            start = self._restart(ended_before)
            observation, speed = _scenarios_first(start.observation), np.asarray(start.speed)
            reward = np.where(ended_before, 0.0, reward)
            terminated, truncated = terminated & ~ended_before, truncated & ~ended_before
        self._has_ended = terminated | truncated
        crashed = terminated
        if self._mode is AutoresetMode.SAME_STEP and self._has_ended.any():
            final = _last_of(observation, speed, crashed, self._has_ended)
            start = self._restart(self._has_ended)
            observation, speed = _scenarios_first(start.observation), np.asarray(start.speed)
            crashed = crashed & ~self._has_ended
        return observation, reward, terminated, truncated, final | _info(speed, crashed, all_scenarios)

    def render(self) -> tuple[UInt8[np.ndarray, "height width 3"], ...] | None:  # type: ignore[override]
        """A picture of the present second of every scenario with `render_mode="rgb_array"`, else None.

        Raises:
            RuntimeError: There was no reset.
        """
        if self.render_mode is None:
            return None
        if self._scenarios is None:
            raise RuntimeError("there are no episodes yet: call reset() before render()")
        return tuple(rendering.pictures(self._scenarios.state, self.options))

    def _restart(self, begins: Bool[np.ndarray, " scenarios"]) -> FirstObservation:
        """Observations after new episodes have begun."""
        self._scenarios, start = restart_program(self.options)(self._scenarios, self._starts, begins)
        return start

    def _seeds(self, seed: Any) -> list[int | None]:
        """Seeds, one for each scenario."""
        if np.ndim(seed) == 0:
            first = seed_of(seed)
            return [None if first is None else first + number for number in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds for {self.num_envs} scenarios: give one for each, or a single one")
        return [seed_of(given) for given in seed]

    def _mask(self, options: dict[str, Any] | None) -> Bool[np.ndarray, " scenarios"]:
        """Mask of the scenarios that restart."""
        check_reset_options(options, "reset_mask")
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, bool)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            raise ValueError(
                f"reset_mask must be {self.num_envs} booleans, at least one of them true; got {mask.dtype} {mask.shape}"
            )
        if self._scenarios is None and not mask.all():
            raise ValueError("reset_mask leaves out scenarios that have never begun: reset all first")
        return mask


def _scenarios_first(observation: Any) -> Float[np.ndarray, "scenarios rows columns"]:
    """The observation with the scenario axis first, as a new array that the caller may keep and change."""
    return np.array(np.moveaxis(np.asarray(observation), -1, 0), order="C")


def _info(speed: np.ndarray, crashed: np.ndarray, has_values: np.ndarray) -> dict[str, Any]:
    """Values by name, and under `_name` the mask of the scenarios that have values; 0 for all other scenarios."""
    values = {"speed": speed.astype(np.float64), "crashed": crashed}
    zeroed = {name: np.where(has_values, value, value.dtype.type(0)) for name, value in values.items()}
    return zeroed | {f"_{name}": has_values.copy() for name in values}


def _last_of(observation: np.ndarray, speed: np.ndarray, crashed: np.ndarray, ended: np.ndarray) -> dict[str, Any]:
    """Observation and info at the end of episodes whose successors have already begun."""
    last = np.full(len(ended), None, object)
    for number in np.flatnonzero(ended):
        last[number] = observation[number].copy()
    return {
        "final_obs": last,
        "_final_obs": ended.copy(),
        "final_info": _info(speed, crashed, ended),
        "_final_info": ended.copy(),
    }

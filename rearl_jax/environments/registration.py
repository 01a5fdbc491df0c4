"""Registration of the environment in Gymnasium, under its id."""

from typing import Any, overload

import gymnasium

from rearl_jax.problems import out_of_range

ENV_ID = "rearl_jax/Highway-v0"


def register() -> None:
    """Registers the environment with Gymnasium; its module is only imported when an environment is made."""
    gymnasium.register(
        ENV_ID,
        entry_point="rearl_jax.environments.single:HighwayEnv",
        vector_entry_point="rearl_jax.environments.vector:HighwayVectorEnv",
    )


@overload
def make_env(num_envs: None = None, **options: Any) -> gymnasium.Env: ...


@overload
def make_env(num_envs: int, **options: Any) -> gymnasium.vector.VectorEnv: ...


def make_env(num_envs: int | None = None, **options: Any) -> gymnasium.Env | gymnasium.vector.VectorEnv:
    """A Gymnasium environment: one vehicle drives by meta-actions among traffic of IDM and MOBIL.

    The same as `gymnasium.make("rearl_jax.environments:rearl_jax/Highway-v0", **options)`, or `gymnasium.make_vec` of
    it. Example:

        env = rearl_jax.make_env(n_others=20)
        observation, info = env.reset(seed=0)
        observation, reward, terminated, truncated, info = env.step(rearl_jax.MetaAction.FASTER)

    Args:
        num_envs: Scenarios that run in lockstep in a vector environment; None for a single environment.
        **options: `scenes` (measured ones to begin with), `boundary` (`free`, `leaders` or `measured`: the recorded
            vehicles replayed around them) with `data` (recordings of the scenes, as given to `cut_scenes`),
            `render_mode` (`rgb_array` or None), the fields of `environments.highway.HighwayOptions`, and those of
            `gymnasium.make` or `gymnasium.make_vec`.

    Raises:
        ValueError: An option is unknown or outside its range, or the scenes do not fit the road or the
            boundary.
    """
    mode = options.get("render_mode")
    if not isinstance(mode, str | None):  # Gymnasium would take it for a text
        raise out_of_range("render_mode", "must be rgb_array, or None", repr(mode))
    if num_envs is None:
        return gymnasium.make(ENV_ID, **options)
    return gymnasium.make_vec(ENV_ID, num_envs, **options)

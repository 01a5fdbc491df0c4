"""HighJax as the subject of a measurement: highway-env in JAX, many scenes at a time in one compiled program."""

from collections.abc import Mapping
from functools import partial
from importlib import import_module
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Key

from rearl_jax.timing.measurement import TICKS_PER_SECOND, Measurement, Stopwatch

IDLE = 1
"""Action of the vehicle that HighJax leaves to a policy: it keeps lane and speed."""

PAIRS_AT_A_TIME, LARGEST_BATCH = 200_000, 512
"""Pairs of vehicles, all of which HighJax compares, in the scenes simulated at a time; and the largest number of these
scenes.
"""


class HighJaxRoads:
    """Scenes of `highjax-v0`, whose vehicles are drawn as in highway-env; whole seconds are measured."""

    def __init__(self, n_vehicles: int, seconds: int, density: float, cpu_s: float) -> None:
        """Compiles and warms up.

        Args:
            n_vehicles: Vehicles per scene, the idle one included.
            seconds: Simulated time [s].
            density: `vehicles_density` of highway-env [-].
            cpu_s: CPU time after which a measurement ends with the second it is in [s].
        """
        self._n_vehicles, self._seconds, self._cpu_s = n_vehicles, seconds, cpu_s
        self._batch = min(max(1, PAIRS_AT_A_TIME // n_vehicles**2), LARGEST_BATCH)
        env, parameters = import_module("highjax").make("highjax-v0", n_npcs=n_vehicles - 1)
        parameters = parameters.replace(vehicles_density=density, duration=float(seconds + 1))

        def second(state: Any, key: Key[Array, ""]) -> Any:
            return env.step_env(key, state, IDLE, parameters)[1]

        self._second = jax.jit(jax.vmap(second))
        self._draw = jax.jit(jax.vmap(partial(_initial_state, env, parameters)))
        self.measure(self._batch, 0)

    @property
    def facts(self) -> Mapping[str, float | int]:
        """`unit`: scenes simulated at a time."""
        return {"unit": self._batch}

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of whole batches, simulated for fewer seconds if they would take longer than `cpu_s`."""
        n_batches = max(1, n_scenarios // self._batch)
        keys = jax.random.split(jax.random.key(seed), (n_batches, self._batch))
        states = [jax.block_until_ready(self._draw(batch_keys)) for batch_keys in keys]
        watch, seconds = Stopwatch(), 0
        while seconds < self._seconds and watch.cpu_s < self._cpu_s:
            with watch:
                states = jax.block_until_ready([self._second(*pair) for pair in zip(states, keys, strict=True)])
            seconds += 1
        n_scenes = n_batches * self._batch
        speeds = [float(np.mean(_speeds(state))) for state in states]
        return Measurement(
            n_scenarios=n_scenes,
            seconds=seconds,
            n_substeps=n_scenes * self._n_vehicles * seconds * TICKS_PER_SECOND,
            cpu_s=watch.cpu_s,
            wall_s=watch.wall_s,
            mean_speed=float(np.mean(speeds)),
        )


def _initial_state(env: Any, parameters: Any, key: Key[Array, ""]) -> Any:
    return env.reset(key, parameters)[1]


def _speeds(state: Any) -> np.ndarray:
    """Speeds of all vehicles of all scenes [m/s]."""
    column = import_module("highjax").kinematics.SPEED
    everybody = (state.ego_state[:, None], state.npc_states)
    return np.concatenate([np.asarray(vehicles)[..., column] for vehicles in everybody], axis=1)

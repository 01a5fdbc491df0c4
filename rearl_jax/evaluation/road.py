"""The road that an evaluation simulates."""

from dataclasses import replace
from typing import TypeVar

from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.data.scenes.initial_states import recorded_road
from rearl_jax.data.scenes.scene_set import SceneSet

Task = TypeVar("Task", bound=EvaluateTask)


def with_road(config: Task, scenes: SceneSet) -> Task:
    """The configuration with the road of the recordings if scenes start as recorded, else unchanged.

    Raises:
        InvalidInputError: The recordings have more lanes than a simulated road can have.
    """
    if config.init.source is not InitialSource.scene:
        return config
    return replace(config, core=recorded_road(config.core, scenes))

"""Recorded traffic that is replayed around simulated scenes (`scenes.boundary`), and the keys that must suit it."""

from rearl_jax._typing import SceneIndices
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.config.scenes import BoundarySource, SpeedNorm
from rearl_jax.data.scenes.boundary import BoundaryOptions, SceneBoundary
from rearl_jax.data.scenes.boundary_cache import kept_boundary
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.traffic import MODEL_METHODS
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


def check_boundary(config: EvaluateTask, *, has_given_scenes: bool = False) -> None:
    """Raise InvalidInputError if `scenes.boundary` asks for replayed traffic and other keys do not permit it.

    Args:
        config: The task.
        has_given_scenes: Whether the caller gave the scenes, instead of recordings in `config.data` to cut them from.
    """
    source = config.scenes.boundary
    if source is BoundarySource.free:
        return
    why = f"for scenes.boundary={source.name}"
    if config.init.source is not InitialSource.scene:
        message = f"must be scene {why}: replayed vehicles fit only scenes that start as recorded"
        raise out_of_range("init.source", message, config.init.source.name)
    if config.speed.norm is not SpeedNorm.none:
        message = f"must be none {why}: rescaled speeds do not fit recorded positions"
        raise out_of_range("speed.norm", message, config.speed.norm.name)
    if config.eval.seed_scope is not SeedScope.run_x_scene:
        message = f"must be run_x_scene {why}: every rollout has the surroundings of its own scene"
        raise out_of_range("eval.seed_scope", message, config.eval.seed_scope.name)
    if config.method not in MODEL_METHODS:
        raise out_of_range("method", f"must be base or rearl {why}", config.method.name)
    if config.decision.policy.is_outside:
        message = f"must be a policy inside the compiled program {why}"
        raise out_of_range("decision.policy", message, config.decision.policy.name)
    if has_given_scenes:
        message = "needs whole recordings, because the given scenes contain only some of the recorded vehicles"
        remedy = "give a table of trajectories instead of scenes, or name the recordings with data"
        raise InvalidInputError(Problem("recordings-needed", message, remedy, key="scenes.boundary", value=source.name))


def recorded_boundary(config: EvaluateTask, scenes: SceneSet, subset: SceneIndices) -> SceneBoundary | None:
    """Recorded traffic around the scenes with the indices `subset`, from the recordings of the task; None for
    `scenes.boundary=free`.

    Raises:
        InvalidInputError: Other keys do not permit replayed traffic, or the lane of a vehicle is unknown.
    """
    check_boundary(config)
    source = config.scenes.boundary
    if source is BoundarySource.free:
        return None
    options = BoundaryOptions(source, config.core.ticks_per_second, scenes.is_one_way)
    return kept_boundary(config.data, scenes, subset, options)

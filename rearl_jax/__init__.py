"""Batch highway traffic simulation in JAX, held to measured trajectories.

Names are imported on first use, so that `import rearl_jax` and `rearl --help` do not wait for JAX.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rearl_jax.config import DataConfig, PrepareTask
    from rearl_jax.core.batch import ScenarioMap
    from rearl_jax.core.drivers import Drivers, highway_env_drivers
    from rearl_jax.core.meta_actions import MetaAction
    from rearl_jax.core.model import TrafficModel
    from rearl_jax.core.rollout import Frames, rollout
    from rearl_jax.core.spawn import spawn
    from rearl_jax.core.state import Controller, TrafficState, make_state
    from rearl_jax.core.step import tick
    from rearl_jax.data.recordings import Recording, RecordingInfo, iterate_recordings
    from rearl_jax.data.scene_files import load_scenes
    from rearl_jax.data.scene_set import SceneSet
    from rearl_jax.data.scenes import build_scenes
    from rearl_jax.data.splits import split_scenes
    from rearl_jax.metrics import METRICS
    from rearl_jax.results import Study, read_metadata

__version__ = "0.1.0"

_HOMES = {
    "Controller": "rearl_jax.core.state",
    "DataConfig": "rearl_jax.config",
    "Drivers": "rearl_jax.core.drivers",
    "Frames": "rearl_jax.core.rollout",
    "METRICS": "rearl_jax.metrics",
    "MetaAction": "rearl_jax.core.meta_actions",
    "PrepareTask": "rearl_jax.config",
    "Recording": "rearl_jax.data.recordings",
    "RecordingInfo": "rearl_jax.data.recordings",
    "ScenarioMap": "rearl_jax.core.batch",
    "SceneSet": "rearl_jax.data.scene_set",
    "Study": "rearl_jax.results",
    "TrafficModel": "rearl_jax.core.model",
    "TrafficState": "rearl_jax.core.state",
    "build_scenes": "rearl_jax.data.scenes",
    "highway_env_drivers": "rearl_jax.core.drivers",
    "iterate_recordings": "rearl_jax.data.recordings",
    "load_scenes": "rearl_jax.data.scene_files",
    "make_state": "rearl_jax.core.state",
    "read_metadata": "rearl_jax.results",
    "rollout": "rearl_jax.core.rollout",
    "spawn": "rearl_jax.core.spawn",
    "split_scenes": "rearl_jax.data.splits",
    "tick": "rearl_jax.core.step",
}

__all__ = [
    "Controller",
    "DataConfig",
    "Drivers",
    "Frames",
    "METRICS",
    "MetaAction",
    "PrepareTask",
    "Recording",
    "RecordingInfo",
    "ScenarioMap",
    "SceneSet",
    "Study",
    "TrafficModel",
    "TrafficState",
    "__version__",
    "build_scenes",
    "highway_env_drivers",
    "iterate_recordings",
    "load_scenes",
    "make_state",
    "read_metadata",
    "rollout",
    "spawn",
    "split_scenes",
    "tick",
]


def __getattr__(name: str) -> Any:
    """The public object `name`, imported from the module that owns it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))

"""Batch highway traffic simulation in JAX, held to measured trajectories.

Names are imported on first use, so that `import rearl_jax` and `rearl --help` do not wait for JAX.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rearl_jax.config import DataConfig, PrepareTask
    from rearl_jax.data.recordings import Recording, RecordingInfo, iterate_recordings
    from rearl_jax.data.scene_files import load_scenes
    from rearl_jax.data.scene_set import SceneSet
    from rearl_jax.data.scenes import build_scenes
    from rearl_jax.data.splits import split_scenes
    from rearl_jax.metrics import METRICS
    from rearl_jax.results import Study, read_metadata

__version__ = "0.1.0"

_HOMES = {
    "DataConfig": "rearl_jax.config",
    "METRICS": "rearl_jax.metrics",
    "PrepareTask": "rearl_jax.config",
    "Recording": "rearl_jax.data.recordings",
    "RecordingInfo": "rearl_jax.data.recordings",
    "SceneSet": "rearl_jax.data.scene_set",
    "Study": "rearl_jax.results",
    "build_scenes": "rearl_jax.data.scenes",
    "iterate_recordings": "rearl_jax.data.recordings",
    "load_scenes": "rearl_jax.data.scene_files",
    "read_metadata": "rearl_jax.results",
    "split_scenes": "rearl_jax.data.splits",
}

__all__ = [
    "DataConfig",
    "METRICS",
    "PrepareTask",
    "Recording",
    "RecordingInfo",
    "SceneSet",
    "Study",
    "__version__",
    "build_scenes",
    "iterate_recordings",
    "load_scenes",
    "read_metadata",
    "split_scenes",
]


def __getattr__(name: str) -> Any:
    """The public object `name`, imported from the module that owns it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))

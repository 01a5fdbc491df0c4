"""Recorded traffic around scenes, stored on disk: read once per machine, data set and choice of scenes."""

from dataclasses import asdict, fields

import numpy as np

from rearl_jax.cache import kept_path, read_arrays, write_arrays
from rearl_jax.config.data import DataConfig
from rearl_jax.data.recordings import data_id, file_stamps, iterate_recordings
from rearl_jax.data.scenes.boundary import BoundaryOptions, SceneBoundary, cut_boundary
from rearl_jax.data.scenes.scene_set import SceneSet

_SOURCES = ("config", "data")
"""Parts of the package whose code decides what is read."""


def kept_boundary(data: DataConfig, scenes: SceneSet, subset: np.ndarray, options: BoundaryOptions) -> SceneBoundary:
    """The recorded traffic of `cut_boundary`, from disk if it was read before; `data` is what the scenes were cut from.

    Raises:
        InvalidInputError: The lane of a vehicle is unknown, or a recording is missing or was replaced by another one.
    """
    keys = {
        "data": data_id(data),
        "files": file_stamps(data),
        "scenes": scenes.data_id,
        "subset": np.asarray(subset).tolist(),
        **asdict(options),
        "source": options.source.name,
    }
    path = kept_path("boundaries", keys, _SOURCES, ".npz")
    arrays = read_arrays(path)
    if arrays is not None:
        return SceneBoundary(**arrays)
    boundary = cut_boundary(iterate_recordings(data), scenes, subset, options)
    write_arrays(path, {item.name: getattr(boundary, item.name) for item in fields(boundary)})
    return boundary

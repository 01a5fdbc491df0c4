"""Names shared by all annotations of the package.

Axis names, the same in annotations and docstrings: `scenes` recorded windows, `steps` points in time, `vehicles`,
`lanes`, `bins`, `refs` representative scenes, `draws` resamples, `scenarios` independent rollouts of one batch (the
last, contiguous axis of the core).
"""

from typing import TypeAlias

import numpy as np
from jaxtyping import Array, Float, Int, Key

ScalarLike: TypeAlias = float | Float[Array, ""]
"""A number outside `jax.jit`, a zero-dimensional array inside."""

PRNGKey: TypeAlias = Key[Array, ""]
"""One typed random key, `jax.random.key(seed)`."""

SceneIndices: TypeAlias = Int[np.ndarray, " scenes"]
"""Indices of some scenes of a `SceneSet`."""

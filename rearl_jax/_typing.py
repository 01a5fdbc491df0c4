"""Names shared by all annotations of the package.

Axis names, the same in annotations and docstrings: `scenes` recorded windows, `steps` points in time, `vehicles`,
`lanes`, `bins`, `refs` representative scenes, `draws` resamples, `scenarios` independent rollouts of one batch (the
last, contiguous axis of the core).
"""

from typing import TypeAlias

from jaxtyping import Array, Float, Key

ScalarLike: TypeAlias = float | Float[Array, ""]
"""A number outside `jax.jit`, a zero-dimensional array inside."""

PRNGKey: TypeAlias = Key[Array, ""]
"""One typed random key, `jax.random.key(seed)`."""

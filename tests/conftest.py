"""Strict JAX for every test. The package itself must not be imported here: the shape check of the
jaxtyping plugin hooks into the import, and would come too late."""

import os

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

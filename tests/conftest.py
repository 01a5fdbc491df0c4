"""Strict JAX for every test. The package itself must not be imported here: the shape check of the
jaxtyping plugin hooks into the import, and would come too late."""

import logging
import os

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(autouse=True)
def logging_reaches_the_tests():
    """What one test, or a library in it, has switched off must not silence the next one."""
    logging.disable(logging.NOTSET)
    for name, logger in list(logging.root.manager.loggerDict.items()):
        if name.startswith("rearl_jax") and isinstance(logger, logging.Logger):
            logger.disabled, logger.propagate = False, True

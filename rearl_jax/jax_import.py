"""Import of JAX; an environment variable with a value that JAX cannot use becomes an error that names it."""

import os

from rearl_jax.problems import InvalidInputError, Problem

_COUNT = "JAX_NUM_CPU_DEVICES"


def import_jax() -> None:
    """Imports JAX, so that a later import finds it.

    Raises:
        InvalidInputError: A variable of the environment has a value that JAX does not accept.
    """
    try:
        import jax
    except ValueError as error:
        named = [name for name in os.environ if name.startswith("JAX_") and name.lower() in str(error).lower()]
        if not named:
            raise
        raise _unusable(max(named, key=len), f"has a value that JAX does not accept ({error})") from None
    if _COUNT in os.environ and getattr(jax.config, "jax_num_cpu_devices", None) == 0:
        raise _unusable(_COUNT, "must be at least 1")


def _unusable(name: str, fault: str) -> InvalidInputError:
    return InvalidInputError(
        Problem("variable-unusable", fault, "correct or unset it", key=name, value=os.environ[name])
    )

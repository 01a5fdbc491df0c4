"""Arguments of the Gymnasium environments: whole numbers of any library, seeds, and options of a reset."""

import operator
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Integer

from rearl_jax.problems import InvalidInputError, Problem, out_of_range


def whole_numbers(values: Any) -> Integer[np.ndarray, "..."] | None:
    """The values as an array; None if they are not whole numbers, or are nested unevenly."""
    try:
        array = np.asarray(values)
    except ValueError:
        return None
    return array if np.issubdtype(array.dtype, np.integer) else None


def number_of_scenarios(num_envs: Any) -> int:
    """The number of scenarios; raises InvalidInputError if it is not a whole number from 1."""
    number = whole_numbers(num_envs)
    if number is None or number.ndim or number < 1:
        raise out_of_range("num_envs", "must be a whole number, at least 1", repr(num_envs))
    return int(number)


def seed_of(seed: Any) -> int | None:
    """A seed given as a Python, NumPy or JAX scalar as a Python number; None for None.

    Raises:
        ValueError: The seed is not a whole number from 0.
    """
    try:
        number = None if seed is None else operator.index(seed)
    except TypeError:
        number = -1
    if number is not None and number < 0:
        raise ValueError(f"seeds must be whole numbers from 0, or None to continue; got {seed!r}")
    return number


def check_reset_options(options: Any, *known: str) -> None:
    """Raise InvalidInputError for options of `reset` that are not a mapping, or for one that is not known."""
    if not isinstance(options, Mapping | None):
        raise InvalidInputError(Problem("wrong-type", "must be a mapping, or None", key="options", value=repr(options)))
    for name in sorted((options or {}).keys() - set(known), key=str):
        remedy = f"leave it out{f'; there is {known[0]}' if known else ''}, and give other options to make_env"
        raise InvalidInputError(Problem("key-unknown", "is not an option of reset()", remedy, key=str(name)))

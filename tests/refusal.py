"""Expecting a problem of what a user has given, by its code and fields."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from rearl_jax.problems import InvalidInputError, ProblemError


@contextmanager
def refused(
    code: str, error: type[ProblemError] = InvalidInputError, **fields: object
) -> Iterator[pytest.ExceptionInfo[ProblemError]]:
    """Fails unless the block raises a problem of this code with these fields, such as column="x", row=3."""
    with pytest.raises(error) as caught:
        yield caught
    problem = caught.value.problem
    assert {"code": problem.code, **{name: getattr(problem, name) for name in fields}} == {"code": code, **fields}

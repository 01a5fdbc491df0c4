"""Range checks of numbers, shared by several records; null is accepted."""

import math

from rearl_jax.config._schema import as_written
from rearl_jax.problems import out_of_range


def check_rising(record: object, *names: str) -> None:
    """Raise InvalidInputError unless each of these keys contains only ascending numbers from 1 on, and at least one."""
    for name in names:
        values = list(getattr(record, name))
        if not values or values != sorted(set(values)) or values[0] < 1:
            raise out_of_range(name, "must be positive numbers in ascending order", values)


def check_finite(record: object, *names: str) -> None:
    """Raise InvalidInputError for an infinite number in one of these keys, each a number or several."""
    for name in names:
        value = getattr(record, name)
        values = value if isinstance(value, tuple) else (value,)
        if any(isinstance(part, float) and math.isinf(part) for part in values):
            raise out_of_range(name, "must be finite", as_written(value))


def check_least(record: object, least: float, *names: str) -> None:
    """Raise InvalidInputError unless the values of these keys are at least `least`."""
    for name in names:
        value = getattr(record, name)
        if value is not None and not value >= least:
            raise out_of_range(name, f"must be at least {least}", value)


def check_positive(record: object, *names: str) -> None:
    """Raise InvalidInputError unless the values of these keys are greater than zero."""
    for name in names:
        value = getattr(record, name)
        if value is not None and not value > 0:
            raise out_of_range(name, "must be > 0", value)


def check_within(record: object, least: float, greatest: float, *names: str) -> None:
    """Raise InvalidInputError unless the values of these keys are within two bounds, which are allowed."""
    for name in names:
        value = getattr(record, name)
        if value is not None and not least <= value <= greatest:
            raise out_of_range(name, f"must be within {least} and {greatest}", value)

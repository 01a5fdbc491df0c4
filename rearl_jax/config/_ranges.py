"""Ranges of numbers, as several records check them."""

from rearl_jax.problems import out_of_range


def check_rising(record: object, *names: str) -> None:
    """Raise InvalidInputError unless these keys hold positive, rising numbers, at least one each."""
    for name in names:
        values = list(getattr(record, name))
        if not values or values != sorted(set(values)) or values[0] < 1:
            raise out_of_range(name, "must be positive, rising numbers", values)


def check_least(record: object, least: int, *names: str) -> None:
    """Raise InvalidInputError unless these keys are at least a number."""
    for name in names:
        if getattr(record, name) < least:
            raise out_of_range(name, f"must be at least {least}", getattr(record, name))


def check_positive(record: object, *names: str) -> None:
    """Raise InvalidInputError unless these keys are greater than zero."""
    for name in names:
        if not getattr(record, name) > 0:
            raise out_of_range(name, "must be > 0", getattr(record, name))

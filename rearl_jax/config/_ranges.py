"""Ranges of numbers, as several records check them."""


def check_rising(record: object, *names: str) -> None:
    """Raise ValueError unless these keys hold positive, rising numbers, at least one each."""
    for name in names:
        values = list(getattr(record, name))
        if not values or values != sorted(set(values)) or values[0] < 1:
            raise ValueError(f"{name} must be positive, rising numbers, got {values}")


def check_least(record: object, least: int, *names: str) -> None:
    """Raise ValueError unless these keys are at least a number."""
    for name in names:
        if getattr(record, name) < least:
            raise ValueError(f"{name} must be at least {least}, got {getattr(record, name)}")


def check_positive(record: object, *names: str) -> None:
    """Raise ValueError unless these keys are greater than zero."""
    for name in names:
        if not getattr(record, name) > 0:
            raise ValueError(f"{name} must be > 0, got {getattr(record, name)}")

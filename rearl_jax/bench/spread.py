"""A figure that was measured in every repetition: its median and how far it was off."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class Spread:
    """A figure of every repetition: median, least and greatest."""

    median: float
    least: float
    greatest: float


def spread_of(values: Sequence[float]) -> Spread:
    """Spread of the values of the repetitions."""
    return Spread(median(values), min(values), max(values))


def three(spread: Spread) -> tuple[float, float, float]:
    """Median, least and greatest."""
    return spread.median, spread.least, spread.greatest


def with_spread(name: str, spread: Spread) -> dict[str, float]:
    """The three under the keys of a summary."""
    return {name: spread.median, f"{name}_min": spread.least, f"{name}_max": spread.greatest}

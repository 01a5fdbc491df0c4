"""Shares of the driver classes: one point, and the grid that is searched."""

from itertools import product
from typing import NamedTuple

GRID_STEPS = 5
"""Number of steps of a share from 0 to 1; five steps give a grid of 56 points."""


class Mixture(NamedTuple):
    """Shares of three classes of drivers [-], each within 0 and 1, with a sum of at most 1; the rest is regular."""

    aggressive: float
    defensive: float
    truck: float

    @property
    def regular(self) -> float:
        """Share of the regular drivers [-]."""
        return max(0.0, 1.0 - sum(self))

    def written(self) -> str:
        """The shares as text."""
        shares = (*zip(self._fields, self, strict=True), ("regular", self.regular))
        return ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares)


ALL_REGULAR = Mixture(0.0, 0.0, 0.0)
"""Mixture that a language model starts from."""


def grid(steps: int = GRID_STEPS) -> list[Mixture]:
    """All mixtures whose shares are multiples of 1 / steps."""
    numbers = product(range(steps + 1), repeat=3)
    return [Mixture(*(number / steps for number in point)) for point in numbers if sum(point) <= steps]

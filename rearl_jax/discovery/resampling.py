"""Resamples of drivers: how much a figure depends on which drivers were recorded.

Source: percentile bootstrap, Efron & Tibshirani, An Introduction to the Bootstrap (1993), chapter 13.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

Pool = Callable[..., np.ndarray]
"""Function from values of drivers, along an axis, to one figure."""


def resamples(n: int, draws: int, seed: int | np.random.Generator) -> Int[np.ndarray, "draws drivers"]:
    """Indices of n drivers, drawn with replacement."""
    return np.random.default_rng(seed).integers(0, n, (draws, n))


def bounds(drawn: Float[np.ndarray, "draws *figures"], confidence: float) -> Float[np.ndarray, "two *figures"]:
    """Bounds of the central interval of figures with this confidence [-]."""
    return np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)


@dataclass(frozen=True)
class Resampling:
    """Bootstrap over drivers, with the same draws for all compared figures.

    Attributes:
        confidence: Confidence of the intervals [-].
        draws: Number of resamples.
        seed: Seed of the draws.
    """

    confidence: float
    draws: int
    seed: int

    def samples(self, n: int) -> Int[np.ndarray, "figures drivers"]:
        """Indices of n drivers: all of them, then each resample."""
        return np.concatenate([[np.arange(n)], resamples(n, self.draws, self.seed)])

    def drawn(self, values: Float[np.ndarray, " drivers"], pool: Pool) -> Float[np.ndarray, " figures"]:
        """The figure of all drivers, then that of each resample."""
        return pool(values[self.samples(len(values))], axis=1)

    def figure(self, drawn: Float[np.ndarray, " figures"]) -> dict[str, float]:
        """A figure {value, low, high} of the verdict."""
        low, high = bounds(drawn[1:], self.confidence).tolist()
        return {"value": float(drawn[0]), "low": low, "high": high}

    def change(self, before: np.ndarray, after: np.ndarray, pool: Pool) -> dict[str, dict[str, float]]:
        """Figures of the drivers' values before and after, and of the change."""
        first, second = self.drawn(before, pool), self.drawn(after, pool)
        return {"before": self.figure(first), "after": self.figure(second), "change": self.figure(second - first)}

"""Disjoint parts of measured drivers: models are fitted, checked and reported on different drivers."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.thresholds import THRESHOLDS

SHARES = (1 / 3, 1 / 3, 1 / 3)
"""Shares of drivers that are fitted, checked and reported."""


def split_drivers(data: Measured, shares: Sequence[float] = SHARES, seed: int = 0) -> list[Measured]:
    """Parts of the data without common drivers: whole persons or cars if there are enough of similar size, else whole
    recordings of similar size, else random drivers.

    Args:
        data: All drivers.
        shares: Shares of each part; they sum to 1.
        seed: Seed of the order of drivers.
    """
    owner = None
    if n_identified(data) >= THRESHOLDS.least_drivers:
        # A driver without known identity counts as a separate person.
        alone = data.identity.max() + 1 + data.driver
        owner = _whole(np.where(data.identity < 0, alone, data.identity), shares)
    if owner is None:
        owner = _whole(data.recording, shares)
    if owner is None:
        rng = np.random.default_rng(seed)
        order = rng.permutation(data.n_drivers)
        edges = np.round(np.cumsum(shares) * data.n_drivers).astype(int)
        part_of = np.searchsorted(edges, np.argsort(order), side="right")
        owner = part_of[data.driver]
    return [data.select(np.flatnonzero(owner == part)) for part in range(len(shares))]


def n_identified(data: Measured) -> int:
    """Number of persons or cars with known identity."""
    return len(np.unique(data.identity[data.identity >= 0]))


def n_shared(first: Measured, second: Measured) -> int:
    """Number of persons or cars with tracks in both parts."""
    return len(np.setdiff1d(np.intersect1d(first.identity, second.identity), [-1]))


def _whole(units: Int[np.ndarray, " pieces"], shares: Sequence[float]) -> Int[np.ndarray, " pieces"] | None:
    """Part of each piece, without dividing any unit (person or recording): units are assigned from the largest to the
    smallest, each to the least filled part. None if the sizes of the parts differ too much.
    """
    owner, filled = np.full(len(units), -1), np.zeros(len(shares))
    numbers, sizes = np.unique(units, return_counts=True)
    for place in np.argsort(-sizes, kind="stable"):
        part = int(np.argmin(filled / np.array(shares)))
        owner[units == numbers[place]] = part
        filled[part] += sizes[place]
    is_filled = filled >= THRESHOLDS.least_part_filled * np.array(shares) * sizes.sum()
    return owner if is_filled.all() else None

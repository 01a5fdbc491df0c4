"""Disjoint parts of measured drivers: models are fitted to one, checked on another, and errors reported for a third."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.thresholds import THRESHOLDS

SHARES = (1 / 3, 1 / 3, 1 / 3)
"""Shares of the drivers for the fit, the check and the report."""


def split_drivers(data: Measured, shares: Sequence[float] = SHARES, seed: int = 0) -> list[Measured]:
    """Parts of the data without common drivers. Persons or cars are kept together if parts of the wanted sizes result,
    else whole recordings if these give the wanted sizes; else drivers are assigned at random. Sizes are numbers of
    pieces, so that parts have similar amounts of data, but no part may have fewer drivers than its share of
    `least_drivers`.

    Args:
        data: All drivers.
        shares: Shares of each part; they sum to 1.
        seed: Seed of the order of drivers.
    """
    part_of_piece = None
    if n_identified(data) >= THRESHOLDS.least_drivers:
        # A driver without known identity counts as a separate person.
        separate = data.identity.max() + 1 + data.driver
        part_of_piece = _undivided(np.where(data.identity < 0, separate, data.identity), data.driver, shares)
    if part_of_piece is None:
        part_of_piece = _undivided(data.recording, data.driver, shares)
    if part_of_piece is None:
        rng = np.random.default_rng(seed)
        order = rng.permutation(data.n_drivers)
        edges = np.round(np.cumsum(shares) * data.n_drivers).astype(int)
        part_of_driver = np.searchsorted(edges, np.argsort(order), side="right")
        part_of_piece = part_of_driver[data.driver]
    return [data.select(np.flatnonzero(part_of_piece == part)) for part in range(len(shares))]


def n_identified(data: Measured) -> int:
    """Number of persons or cars with known identity."""
    return len(np.unique(data.identity[data.identity >= 0]))


def n_shared(first: Measured, second: Measured) -> int:
    """Number of persons or cars with tracks in both parts."""
    return len(np.setdiff1d(np.intersect1d(first.identity, second.identity), [-1]))


def _undivided(
    units: Int[np.ndarray, " pieces"], driver: Int[np.ndarray, " pieces"], shares: Sequence[float]
) -> Int[np.ndarray, " pieces"] | None:
    """Part of each piece, without dividing any unit (person or recording): units are assigned from the largest to the
    smallest, each to the least filled part. None if the sizes of the parts differ too much, or if a part has too few
    drivers.
    """
    part_of_piece, filled = np.full(len(units), -1), np.zeros(len(shares))
    numbers, sizes = np.unique(units, return_counts=True)
    for index in np.argsort(-sizes, kind="stable"):
        part = int(np.argmin(filled / np.array(shares)))
        part_of_piece[units == numbers[index]] = part
        filled[part] += sizes[index]
    is_filled = filled >= THRESHOLDS.least_part_filled * np.array(shares) * sizes.sum()
    n_drivers = np.array([len(np.unique(driver[part_of_piece == part])) for part in range(len(shares))])
    has_drivers = n_drivers >= np.floor(THRESHOLDS.least_drivers * np.array(shares))
    return part_of_piece if (is_filled & has_drivers).all() else None

"""Disjoint parts of measured drivers: models are fitted to one, checked on another, and errors reported for a third."""

import numpy as np
from jaxtyping import Int

from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.thresholds import THRESHOLDS

N_PARTS, SHARE = 3, 1 / 3
"""Number of parts, for the fit, the check and the report, and the share of each [-]."""


def split_drivers(data: Measured, seed: int = 0) -> list[Measured]:
    """Three equal parts of the data without common drivers. Persons or cars are kept together if about equal parts
    result, else whole recordings if these do; else drivers are assigned at random. Sizes are numbers of pieces, so that
    parts have similar amounts of data, but no part may have fewer drivers than its share of `least_drivers`.
    """
    part_of_piece = None
    if n_identified(data) >= THRESHOLDS.least_drivers:
        # A driver without known identity counts as a separate person.
        separate = data.identity.max() + 1 + data.driver
        part_of_piece = _undivided(np.where(data.identity < 0, separate, data.identity), data.driver)
    if part_of_piece is None:
        part_of_piece = _undivided(data.recording, data.driver)
    if part_of_piece is None:
        order = np.random.default_rng(seed).permutation(data.n_drivers)
        edges = np.round(np.cumsum([SHARE] * N_PARTS) * data.n_drivers).astype(int)
        part_of_piece = np.searchsorted(edges, np.argsort(order), side="right")[data.driver]
    return [data.select(np.flatnonzero(part_of_piece == part)) for part in range(N_PARTS)]


def n_identified(data: Measured) -> int:
    """Number of persons or cars with known identity."""
    return len(np.unique(data.identity[data.identity >= 0]))


def n_shared(first: Measured, second: Measured) -> int:
    """Number of persons or cars with tracks in both parts."""
    return len(np.setdiff1d(np.intersect1d(first.identity, second.identity), [-1]))


def _undivided(
    units: Int[np.ndarray, " pieces"], driver: Int[np.ndarray, " pieces"]
) -> Int[np.ndarray, " pieces"] | None:
    """Part of each piece, without dividing any unit (person or recording): units are assigned from the largest to the
    smallest, each to the least filled part. None if the sizes of the parts differ too much, or if a part has too few
    drivers.
    """
    part_of_piece, filled = np.full(len(units), -1), np.zeros(N_PARTS)
    numbers, sizes = np.unique(units, return_counts=True)
    for index in np.argsort(-sizes, kind="stable"):
        part = int(np.argmin(filled))
        part_of_piece[units == numbers[index]] = part
        filled[part] += sizes[index]
    is_filled = filled >= THRESHOLDS.least_part_filled * SHARE * sizes.sum()
    n_drivers = np.array([len(np.unique(driver[part_of_piece == part])) for part in range(N_PARTS)])
    has_drivers = n_drivers >= np.floor(THRESHOLDS.least_drivers * SHARE)
    return part_of_piece if (is_filled & has_drivers).all() else None

"""Drives of the same drivers in two parts: one to calibrate each driver's parameters, one to test predictions.

A split consists of two sets of measured drives of the same drivers; no time step counts in both. Drives consist of
pieces: uninterrupted stretches of a driver's record.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.discovery.read.measured import BY_PIECE, Measured

LEAST_TIME = 10.0
"""Smallest time of a driver in the training, and also in the test, for a prediction to be tested [s]."""

MOST_FOLDS = 4
"""Largest number of folds (parts) of one driver's runs; each fold is predicted from the other ones. With more runs than
this, several share a fold.
"""

UNKNOWN = -1
"""Identity of an unknown driver."""


@dataclass(frozen=True)
class Split:
    """Training and test drives of the same drivers.

    Attributes:
        training: Training drives; time steps of the test have the weight 0.
        test: Test drives, beginning at the first tested time step; time steps of the training have the weight 0.
    """

    training: Measured
    test: Measured


def has_enough_data(splits: Sequence[Split]) -> Bool[np.ndarray, " drivers"]:
    """True for drivers with at least LEAST_TIME in the tests and in each training of these tests."""
    trained, tested = (
        np.stack([getattr(split, part).driver_minutes * 60 for split in splits]) for part in ("training", "test")
    )
    return (tested.sum(axis=0) >= LEAST_TIME) & ((trained >= LEAST_TIME) | (tested == 0)).all(axis=0)


def halves(data: Measured) -> Split:
    """Split into the first and the second half of each driver's time that counts; pieces are sorted by time.

    A piece that contains the middle begins there in the test, at the measured position and speed.
    """
    order = np.lexsort((data.surroundings.time[0], data.recording, data.driver))
    n_steps, counts = len(data.y), (data.weight > 0)[:, order].T.ravel()
    driver = np.repeat(data.driver[order], n_steps)
    total = np.bincount(driver, counts, data.n_drivers)
    of_earlier_drivers = np.cumsum(total) - total
    is_second = np.empty((n_steps, len(order)), bool)
    is_second[:, order] = (np.cumsum(counts) - of_earlier_drivers[driver] > total[driver] / 2).reshape(-1, n_steps).T
    training = replace(data, weight=data.weight * ~is_second)
    is_cut = (training.weight > 0).any(axis=0)
    test = replace(data, weight=data.weight * is_second)
    return Split(training, begun_later(test, np.where(is_cut, np.argmax(test.weight > 0, axis=0), 0)))


def begun_later(data: Measured, first: Int[np.ndarray, " pieces"]) -> Measured:
    """Pieces without their first `first` time steps each; the last time step is repeated as padding.

    The number of removed steps is a multiple of the stride if the first remaining step counts.
    """
    source = np.arange(len(data.y))[:, None] + first
    rows = np.minimum(source, len(data.y) - 1)

    def moved(values: np.ndarray) -> np.ndarray:
        return np.take_along_axis(values, rows, axis=0)

    of_steps = {name: moved(getattr(data, name)) for name in BY_PIECE if getattr(data, name).ndim == 2}
    of_steps["weight"] = of_steps["weight"] * (source < len(data.y))
    return replace(data, surroundings=jax.tree.map(moved, data.surroundings), **of_steps)


def left_out_runs(data: Measured) -> list[Split]:
    """Splits that leave out one fold of the runs of every person or car with several known runs: one split for each
    fold, which is its test; empty if nobody has two runs. Each driver of `data` is a run, those of the splits are the
    persons or cars.
    """
    identity = data.identity_of_driver
    several = np.flatnonzero(np.bincount(identity[identity != UNKNOWN], minlength=1) > 1)
    if not len(several):
        return []
    pieces = np.flatnonzero(np.isin(identity, several)[data.driver])
    chosen = data.select(pieces)
    run = data.driver[pieces]
    fold = _folds(data, identity, several)[run]
    chosen = replace(chosen, driver=np.searchsorted(several, identity[run]))
    return [
        Split(
            replace(chosen, weight=chosen.weight * (fold != left_out)),
            replace(chosen, weight=chosen.weight * (fold == left_out)),
        )
        for left_out in range(fold.max() + 1)
    ]


def _folds(data: Measured, identity: Int[np.ndarray, " drivers"], several: np.ndarray) -> Int[np.ndarray, " drivers"]:
    """Fold of each run: the runs of each identity in `several`, in order of time, in at most MOST_FOLDS parts of
    similar size.
    """
    begin = np.full(data.n_drivers, np.inf)
    np.minimum.at(begin, data.driver, data.surroundings.time[0])
    recording, fold = data.driver_values(data.recording), np.zeros(data.n_drivers, int)
    for number_of_person in several:
        runs = np.flatnonzero(identity == number_of_person)
        runs = runs[np.lexsort((begin[runs], recording[runs]))]
        for number, part in enumerate(np.array_split(runs, min(len(runs), MOST_FOLDS))):
            fold[part] = number
    return fold


def error_of_splits(
    splits: Sequence[Split], values: Sequence[Float[np.ndarray, "steps pieces"]]
) -> Float[np.ndarray, " drivers"]:
    """Root mean square of each driver's values over the time steps that count in the tests; one array per split."""
    square, count = np.zeros((2, splits[0].test.n_drivers))
    for split, errors in zip(splits, values, strict=True):
        test = split.test
        square += np.bincount(test.driver, (errors**2 * test.weight).sum(axis=0), test.n_drivers)
        count += np.bincount(test.driver, test.weight.sum(axis=0), test.n_drivers)
    return np.sqrt(square / np.maximum(count, 1.0))

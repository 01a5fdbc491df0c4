"""Energy score of a sample of simulations."""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import TypeVar

import numpy as np
from jaxtyping import Float

Sample = TypeVar("Sample")


def energy_score(
    samples: Sequence[Sample],
    observed: Sample,
    distance: Callable[[Sample, Sample], Float[np.ndarray, " cases"]],
) -> Float[np.ndarray, " cases"]:
    """Energy score E d(X, y) - E d(X, X') / 2 of simulations X, X' of the observation y, in the unit of the distance d.

    Both expectations are means over the samples, the second over pairs of different samples, so that the estimate is
    unbiased for any number of samples. The expected score is lowest if observation and samples have the same
    distribution. NaN with fewer than two samples. Distances that are NaN do not count.

    Args:
        samples: Simulations; each contains all cases.
        observed: The observed value.
        distance: Distance of two samples, case by case; of negative type, such as a mean of Euclidean distances.

    Source: Gneiting & Raftery, J. Am. Stat. Assoc. 102 (2007) 359, section 4.3.
    """
    to_observed = _mean([distance(sample, observed) for sample in samples])
    between = [distance(first, second) for first, second in combinations(samples, 2)]
    return to_observed - _mean(between) / 2 if between else np.full_like(to_observed, np.nan)


def _mean(distances: Sequence[Float[np.ndarray, " cases"]]) -> Float[np.ndarray, " cases"]:
    """Mean of the distances that are numbers; NaN without any."""
    values = np.stack(distances)
    is_known = np.isfinite(values)
    count = is_known.sum(axis=0)
    return np.where(count > 0, np.where(is_known, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)

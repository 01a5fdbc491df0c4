"""k-medoids: from distances of items to candidates, the candidates that serve all items best."""

import numpy as np
from jaxtyping import Float, Int

_MAX_SWAPS = 100
"""Largest number of rounds of `swap`, which needs far fewer on samples of a few hundred."""


def build(distances: Float[np.ndarray, "candidates items"], k: int) -> Int[np.ndarray, " medoids"]:
    """Candidates chosen greedily, each the one that lowers the sum of distances to the nearest medoid most.

    Source: BUILD of PAM, Kaufman & Rousseeuw, Finding Groups in Data (1990), chapter 2.
    """
    nearest = np.full(distances.shape[1], np.inf)
    chosen: list[int] = []
    for _ in range(k):
        cost = np.minimum(distances, nearest).sum(axis=1)
        cost[chosen] = np.inf
        chosen.append(int(cost.argmin()))
        nearest = np.minimum(nearest, distances[chosen[-1]])
    return np.array(chosen)


def farthest_first(distances: Float[np.ndarray, "candidates items"], k: int) -> Int[np.ndarray, " medoids"]:
    """Candidate 0, then always the item farthest from all chosen so far; candidates are the items.

    Source: Gonzalez, Clustering to minimize the maximum intercluster distance, Theor. Comput. Sci. 38 (1985) 293.
    """
    chosen = [0]
    nearest = distances[0].astype(np.float64)
    for _ in range(k - 1):
        nearest[chosen] = -1.0
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, distances[chosen[-1]])
    return np.array(chosen)


def swap(
    distances: Float[np.ndarray, "candidates items"], medoids: Int[np.ndarray, " medoids"]
) -> Int[np.ndarray, " medoids"]:
    """Medoids after the best swaps of a medoid and a candidate, one per round, until none lowers the sum.

    Source: SWAP of PAM, Kaufman & Rousseeuw (1990).
    """
    medoids = medoids.copy()
    cost = distances[medoids].min(axis=0).sum()
    for _ in range(_MAX_SWAPS):
        trials = []
        for position in range(len(medoids)):
            others = np.delete(medoids, position)
            nearest_other = distances[others].min(axis=0) if len(others) else np.inf
            sums = np.minimum(distances, nearest_other).sum(axis=1)
            sums[others] = np.inf
            trials.append(sums)
        position, candidate = np.unravel_index(np.argmin(trials), (len(medoids), len(distances)))
        lowest = trials[position][candidate]
        if not lowest < cost:
            break
        medoids[position], cost = candidate, lowest
    return medoids

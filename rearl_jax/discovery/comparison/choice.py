"""The choice of a car-following model: that of the key `driver`, unless another one predicts other drivers
significantly better, or simulations reject it and not another model that is as likely.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.report.protocols import PREDICTING
from rearl_jax.discovery.resampling import resamples
from rearl_jax.discovery.thresholds import THRESHOLDS

DRAWS = 2000
"""Resamples of drivers."""


@dataclass(frozen=True)
class Choice:
    """The model chosen for a discovery; models are given by their index.

    Attributes:
        chosen: Index of the chosen model.
        better_share: Share of resamples of drivers in which each model is more likely than the first one, that of the
            key `driver` [-].
        best_share: Share of resamples in which each model is the most likely one [-].
        vetoed: Models whose simulations are worse than those of the best model under one of the protocols that predict.
        mean_errors: Geometric mean over the protocols that predict of the mean gap error of each model [m].
    """

    chosen: int
    better_share: list[float]
    best_share: list[float]
    vetoed: frozenset[int]
    mean_errors: list[float]

    def denies(self, other: int) -> bool:
        """True if simulations contradict `other` as a replacement of the chosen model: it is vetoed, unless the chosen
        one is vetoed too and has the larger mean error.
        """
        is_smaller = self.mean_errors[other] < self.mean_errors[self.chosen]
        return other in self.vetoed and not (self.chosen in self.vetoed and is_smaller)


def choice_of(
    gains: Sequence[Float[np.ndarray, " drivers"]], errors: Sequence[Mapping[str, Float[np.ndarray, " _"]]], seed: int
) -> Choice:
    """The most likely of the first model and those that are significantly more likely; if simulations reject the first
    model, also of those that are not significantly less likely. Models that simulations reject are chosen only if they
    reject all of these.

    Args:
        gains: Log-likelihood of each driver under each model minus that under the first model, which is that of the
            key `driver` [nats].
        errors: For each model, gap errors of the drivers who could be tested [m], by protocol; empty for a model that
            was not simulated.
        seed: Seed of the resamples.
    """
    drawn = np.stack([gain[resamples(len(gain), DRAWS, seed)].sum(axis=1) for gain in gains])
    better = (drawn > drawn[0]).mean(axis=1).tolist()
    best = np.bincount(drawn.argmax(axis=0), minlength=len(gains)) / DRAWS
    vetoed = frozenset().union(
        *(_probably_worse([by_protocol.get(name) for by_protocol in errors], seed) for name in PREDICTING)
    )
    first = Choice(0, better, best.tolist(), vetoed, [mean_prediction_error(by_protocol) for by_protocol in errors])
    possible = [
        index
        for index, share in enumerate(better)
        if index == 0
        or (share >= THRESHOLDS.base_confidence and gains[index].sum() > THRESHOLDS.least_base_gain)
        or (0 in vetoed and not is_beaten(gains[index], gains, seed))
    ]
    # A model without simulations is not chosen if others have some.
    possible = [index for index in possible if errors[index] or not any(errors)]
    sound = [index for index in possible if index not in vetoed]
    undenied = [index for index in possible if index == 0 or not first.denies(index)]
    return replace(first, chosen=max(sound or undenied, key=lambda index: float(gains[index].sum())))


def is_beaten(
    own_gains: Float[np.ndarray, " drivers"], gains: Sequence[Float[np.ndarray, " drivers"]], seed: int
) -> bool:
    """True if a model with `own_gains` is significantly less likely than the most likely model."""
    gain = max(gains, key=lambda other: float(other.sum())) - own_gains
    drawn = gain[resamples(len(gain), DRAWS, seed)].sum(axis=1)
    return bool((drawn > 0).mean() >= THRESHOLDS.base_confidence and gain.sum() > THRESHOLDS.least_base_gain)


def mean_prediction_error(errors: Mapping[str, Float[np.ndarray, " _"]]) -> float:
    """Geometric mean over the protocols that predict of the mean gap error [m]; inf without any."""
    means = [errors[name].mean() for name in PREDICTING if name in errors]
    return float(np.exp(np.mean(np.log(means)))) if means else np.inf


def _probably_worse(errors: Sequence[Float[np.ndarray, " tested"] | None], seed: int) -> frozenset[int]:
    """Indices of models whose mean error exceeds the smallest one by more than `base_error_share` in more than
    `base_veto_share` of the resamples of drivers.
    """
    tested = {index: error for index, error in enumerate(errors) if error is not None}
    if not tested:
        return frozenset()
    best = min(tested.values(), key=lambda error: float(error.mean()))
    drawn = resamples(len(best), DRAWS, seed)
    tolerated = (1 + THRESHOLDS.base_error_share) * best[drawn].mean(axis=1)
    return frozenset(
        index
        for index, error in tested.items()
        if (error[drawn].mean(axis=1) > tolerated).mean() > THRESHOLDS.base_veto_share
    )

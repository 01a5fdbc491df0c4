"""The choice of a car-following model: that of the key `driver`, unless another one predicts other drivers
significantly better, or simulations reject it and another model is as likely and predicts better in every protocol.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

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
        worse_than: For each model, those than which it probably predicts worse under one of the protocols that predict.
    """

    chosen: int
    better_share: list[float]
    best_share: list[float]
    vetoed: frozenset[int]
    mean_errors: list[float]
    worse_than: list[frozenset[int]]

    def denies(self, other: int) -> bool:
        """True if simulations contradict `other` as a replacement of the chosen model: it is vetoed, or it probably
        predicts worse than the chosen one, unless the chosen one is vetoed and has the larger mean error.
        """
        if self.chosen in self.vetoed and self.mean_errors[other] < self.mean_errors[self.chosen]:
            return False
        return other in self.vetoed or self.chosen in self.worse_than[other]


def choice_of(
    gains: Sequence[Float[np.ndarray, " drivers"]], errors: Sequence[Mapping[str, Float[np.ndarray, " _"]]], seed: int
) -> Choice:
    """The most likely of the first model and those that are significantly more likely. Three conditions depend on
    simulations:

    - If they reject the first model, a model that is not significantly less likely replaces it too, unless its error is
      larger than that of the first model under one of the protocols that predict.
    - A model that they contradict as a replacement of the first one, see `Choice.denies`, must be more likely beyond
      doubt, because few drivers rarely show for sure that an error is larger.
    - Models that simulations reject are chosen only if they reject all of these.

    `gains` are the log-likelihoods of each driver under each model minus that under the first model, which is that of
    the key `driver` [nats]; `errors` the gap errors of the drivers who could be tested [m], by protocol, empty for a
    model that was not simulated.
    """
    drawn = np.stack([gain[resamples(len(gain), DRAWS, seed)].sum(axis=1) for gain in gains])
    better = (drawn > drawn[0]).mean(axis=1).tolist()
    best = np.bincount(drawn.argmax(axis=0), minlength=len(gains)) / DRAWS
    vetoed = frozenset().union(
        *(_surely_worse([by_protocol.get(name) for by_protocol in errors], seed) for name in PREDICTING)
    )
    worse_than = [
        frozenset(other for other in range(len(errors)) if _is_probably_worse(errors[index], errors[other], seed))
        for index in range(len(errors))
    ]
    mean_errors = [mean_prediction_error(by_protocol) for by_protocol in errors]
    first = Choice(0, better, best.tolist(), vetoed, mean_errors, worse_than)

    def is_more_likely(index: int) -> bool:
        is_significant = better[index] >= THRESHOLDS.base_confidence and gains[index].sum() > THRESHOLDS.least_base_gain
        is_beyond_doubt = drawn[index].mean() > THRESHOLDS.doubtless_base_gain * drawn[index].std()
        return bool(is_significant and (is_beyond_doubt or not first.denies(index)))

    def is_as_likely(index: int) -> bool:
        return not is_beaten(gains[index], gains, seed) and _is_nowhere_worse(errors[index], errors[0])

    possible = [
        index
        for index in range(len(gains))
        if index == 0 or is_more_likely(index) or (0 in vetoed and is_as_likely(index))
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


def _surely_worse(errors: Sequence[Float[np.ndarray, " tested"] | None], seed: int) -> frozenset[int]:
    """Indices of models whose error is larger than the smallest one in more than `base_confidence` of the resamples."""
    tested = {index: error for index, error in enumerate(errors) if error is not None}
    if not tested:
        return frozenset()
    best = min(tested.values(), key=lambda error: float(error.mean()))
    return frozenset(
        index for index, error in tested.items() if _worse_share(error, best, seed) > THRESHOLDS.base_confidence
    )


def _is_probably_worse(
    errors: Mapping[str, Float[np.ndarray, " _"]], others: Mapping[str, Float[np.ndarray, " _"]], seed: int
) -> bool:
    """True if errors are larger than those of another model in more than half of the resamples, under one of the
    protocols that predict.
    """
    return any(_worse_share(errors[name], others[name], seed) > 0.5 for name in _common(errors, others))


def _is_nowhere_worse(
    errors: Mapping[str, Float[np.ndarray, " _"]], others: Mapping[str, Float[np.ndarray, " _"]]
) -> bool:
    """True if the mean error is at most that of another model under all protocols that predict."""
    return all(bool(errors[name].mean() <= others[name].mean()) for name in _common(errors, others))


def _common(errors: Mapping[str, Any], others: Mapping[str, Any]) -> list[str]:
    """Protocols that predict under which both models were tested."""
    return [name for name in PREDICTING if name in errors and name in others]


def _worse_share(error: Float[np.ndarray, " tested"], other: Float[np.ndarray, " tested"], seed: int) -> float:
    """Share of resamples of drivers in which the mean of an error exceeds that of another by more than
    `base_error_share` [-].
    """
    drawn = resamples(len(other), DRAWS, seed)
    tolerated = (1 + THRESHOLDS.base_error_share) * other[drawn].mean(axis=1)
    return float((error[drawn].mean(axis=1) > tolerated).mean())

"""The choice of a car-following model: that of `driver` stays unless another surely predicts other drivers better."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.thresholds import THRESHOLDS

DRAWS = 2000
"""Resamples of drivers."""

VETOING = ("population", "first_half")
"""Protocols under which a model that surely is worse than the best is not chosen: both predict."""


@dataclass(frozen=True)
class Choice:
    """The model that a discovery goes on with.

    Attributes:
        chosen: Its number.
        better_share: Share of resamples of drivers in which each is more likely than the first [-].
        best_share: Share of resamples in which each is the most likely [-].
        vetoed: Those that simulations speak against.
    """

    chosen: int
    better_share: list[float]
    best_share: list[float]
    vetoed: frozenset[int]


def resamples(n: int, seed: int) -> Int[np.ndarray, "draws drivers"]:
    """Drivers drawn anew."""
    return np.random.default_rng(seed).integers(0, n, (DRAWS, n))


def choice_of(
    gains: Sequence[Float[np.ndarray, " drivers"]], errors: Sequence[Mapping[str, Float[np.ndarray, " _"]]], seed: int
) -> Choice:
    """The first model, or the most likely of those that surely are more likely and that simulations do not deny.

    Args:
        gains: Log-likelihood of each driver under each model beyond that under the model of `driver` [nats], that one
            first.
        errors: Gap error [m] of each driver who could be tested, by protocol, of each model; none where no protocol was
            asked.
        seed: Of the resamples.
    """
    drawn = np.stack([one[resamples(len(one), seed)].sum(axis=1) for one in gains])
    better = (drawn > drawn[0]).mean(axis=1).tolist()
    best = np.bincount(drawn.argmax(axis=0), minlength=len(gains)) / DRAWS
    vetoed = frozenset().union(*(_probably_worse([one.get(name) for one in errors], seed) for name in VETOING))
    # Where simulations speak against the first one too, one that does better in the mean of protocols may follow it.
    is_first_denied, means = 0 in vetoed, [mean_prediction_error(one) for one in errors]
    denied = {number for number in vetoed if not is_first_denied or means[number] >= means[0]}
    able = [
        number
        for number, share in enumerate(better)
        if share >= THRESHOLDS.base_confidence
        and gains[number].sum() > THRESHOLDS.least_base_gain
        and number not in denied
        and (errors[number] or not any(errors))  # nobody is chosen unseen where others were simulated
    ]
    chosen = max(able, key=lambda number: float(gains[number].sum()), default=0)
    return Choice(chosen, better, best.tolist(), vetoed)


def is_beaten(one: Float[np.ndarray, " drivers"], gains: Sequence[Float[np.ndarray, " drivers"]], seed: int) -> bool:
    """True if the gains of a model surely are less than the largest ones."""
    gain = max(gains, key=lambda other: float(other.sum())) - one
    drawn = gain[resamples(len(gain), seed)].sum(axis=1)
    return bool((drawn > 0).mean() >= THRESHOLDS.base_confidence and gain.sum() > THRESHOLDS.least_base_gain)


def mean_prediction_error(errors: Mapping[str, Float[np.ndarray, " _"]]) -> float:
    """Mean gap error [m], in the geometric mean of the protocols that predict."""
    means = [errors[name].mean() for name in VETOING if name in errors]
    return float(np.exp(np.mean(np.log(means)))) if means else np.inf


def _probably_worse(errors: Sequence[Float[np.ndarray, " tested"] | None], seed: int) -> frozenset[int]:
    """Models whose mean error more likely than not exceeds the least one by more than is borne."""
    tested = {number: one for number, one in enumerate(errors) if one is not None}
    if not tested:
        return frozenset()
    best = min(tested.values(), key=lambda one: float(one.mean()))
    drawn = resamples(len(best), seed)
    borne = (1 + THRESHOLDS.base_error_share) * best[drawn].mean(axis=1)
    return frozenset(
        number
        for number, one in tested.items()
        if (one[drawn].mean(axis=1) > borne).mean() > THRESHOLDS.base_veto_share
    )

"""The choice of a car-following model: that of `driver` stays unless another surely predicts other drivers better."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import bounded_gains
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
        gains: Log-likelihood of each model beyond that of the first, by driver, within the bounds of what one driver
            can contribute [nats].
        better_share: Share of resamples of drivers in which each is more likely than the first [-].
        best_share: Share of resamples in which each is the most likely [-].
        vetoed: Those that simulations speak against.
    """

    chosen: int
    gains: list[Float[np.ndarray, " drivers"]]
    better_share: list[float]
    best_share: list[float]
    vetoed: frozenset[int]


def resamples(n: int, seed: int) -> Int[np.ndarray, "draws drivers"]:
    """Drivers drawn anew."""
    return np.random.default_rng(seed).integers(0, n, (DRAWS, n))


def choice_of(
    likely: Sequence[Float[np.ndarray, " drivers"]],
    errors: Sequence[Mapping[str, Float[np.ndarray, " tested"]]],
    data: Measured,
    seed: int,
) -> Choice:
    """The first model, or the most likely of those that surely are more likely and that simulations do not deny.

    Args:
        likely: Log-likelihood of each driver [nats] under each model, that of `driver` first.
        errors: Gap error [m] of each driver who could be tested, by protocol, of each model; none where no protocol was
            asked.
        data: The drivers.
        seed: Of the resamples.
    """
    gains = [bounded_gains(one - likely[0], data) for one in likely]
    drawn = np.stack([one[resamples(len(one), seed)].sum(axis=1) for one in gains])
    better = (drawn > drawn[0]).mean(axis=1).tolist()
    best = np.bincount(drawn.argmax(axis=0), minlength=len(gains)) / DRAWS
    vetoed = frozenset().union(*(_surely_worse([one.get(name) for one in errors], seed) for name in VETOING))
    able = [
        number
        for number, share in enumerate(better)
        if share >= THRESHOLDS.base_confidence
        and gains[number].sum() > THRESHOLDS.least_base_gain
        and number not in vetoed
    ]
    chosen = max(able, key=lambda number: float(gains[number].sum()), default=0)
    return Choice(chosen, gains, better, best.tolist(), vetoed)


def is_beaten(
    one: Float[np.ndarray, " drivers"], likely: Sequence[Float[np.ndarray, " drivers"]], data: Measured, seed: int
) -> bool:
    """True if a model surely is less likely than the most likely one."""
    best = max(likely, key=lambda other: float(other.sum()))
    gain = bounded_gains(best - one, data)
    drawn = gain[resamples(len(gain), seed)].sum(axis=1)
    return bool((drawn > 0).mean() >= THRESHOLDS.base_confidence and gain.sum() > THRESHOLDS.least_base_gain)


def _surely_worse(errors: Sequence[Float[np.ndarray, " tested"] | None], seed: int) -> frozenset[int]:
    """Models whose mean error surely exceeds the least one by more than is borne."""
    tested = {number: one for number, one in enumerate(errors) if one is not None}
    if not tested:
        return frozenset()
    best = min(tested.values(), key=lambda one: float(one.mean()))
    drawn = resamples(len(best), seed)
    borne = (1 + THRESHOLDS.base_error_share) * best[drawn].mean(axis=1)
    return frozenset(
        number
        for number, one in tested.items()
        if (one[drawn].mean(axis=1) > borne).mean() >= THRESHOLDS.rejection_share
    )

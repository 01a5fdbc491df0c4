"""Kinds of drivers, found without labels: by their own parameters, and by how evenly they drive.

Every driver is calibrated under one model. What is known of its parameters, and of the size of its noise and how long
that lasts (machines are smoother), goes into mixtures of populations. The number of kinds is that of the largest
evidence among mixtures whose populations are distinct and have enough drivers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rearl_jax.discovery.groups.mixture import Mixture, Seen, drawn_from, one_group, split_further
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.observer import unrest
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.thresholds import THRESHOLDS

MOST_KINDS = 6
"""Kinds that are looked for at most."""

HOPELESS = 10.0
"""Loss of evidence [nats] from which no more kinds are looked for."""

REPLICATES = 39
"""Data sets of one kind that say how often chance gives the evidence for two."""

FACTORS = 2.0 ** np.arange(-4, 4)
"""Factors of the usual noise of drivers and of the time it lasts that innovations are held against [-]."""

FARTHEST = 4.0
"""Spreads from the usual driver at which a driver's numbers are taken to lie at most [-]: far beyond what was seen, the
likelihood is not the parabola that it is taken for.
"""

HARDLY_KNOWN = 0.1
"""Information about a number below which it is taken to be as usual [-]."""

LARGEST = 4.0
"""Innovations beyond so many standard deviations count as that much [-]."""

DRAWS = 200
"""Random assignments that the purity by chance is the mean of."""


@dataclass(frozen=True)
class Kinds:
    """Kinds of drivers.

    Attributes:
        of_driver: Number of the kind of each driver, from 1, the largest first; None where it is uncertain.
        evidence: Log-likelihood of each mixture less its price [nats], from one kind on.
        distinctness: Of each mixture, see `Mixture.distinctness`.
        gain: Evidence for the best mixture of several kinds above that for one [nats].
        chance: Share of data sets of one kind with a gain as large as that [-].
    """

    of_driver: list[int | None]
    evidence: list[float]
    distinctness: list[float]
    gain: float
    chance: float

    @property
    def n(self) -> int:
        """Number of kinds."""
        return max((kind for kind in self.of_driver if kind is not None), default=1)

    def names(self) -> list[str | None]:
        """Name of each driver's kind."""
        return [None if kind is None else f"kind {kind}" for kind in self.of_driver]

    def plain(self) -> dict[str, Any]:
        """As in verdict.json."""
        return {
            "kinds": self.n,
            "evidence": list(map(float, self.evidence)),
            "distinctness": self.distinctness,
            "gain": float(self.gain),
            "chance": self.chance,
            "uncertain": sum(kind is None for kind in self.of_driver),
        }


def kinds_of(seen: Seen, seed: int) -> Kinds:
    """Kinds of drivers, one kind unless the evidence for more is what one kind hardly ever gives."""
    mixtures = [one_group(seen)]
    distinctness = [1.0]
    while len(mixtures) < MOST_KINDS and len(seen.weighted) >= (len(mixtures) + 1) * THRESHOLDS.least_drivers:
        mixtures.append(split_further(seen, mixtures[-1]))
        distinctness.append(mixtures[-1].distinctness())
        if mixtures[-1].evidence < max(one.evidence for one in mixtures) - HOPELESS:
            break
    best = max(
        (one for one, distinct in zip(mixtures, distinctness, strict=True) if _are_kinds(one, distinct)),
        key=lambda one: one.evidence,
    )
    gain = best.evidence - mixtures[0].evidence
    chance = 1.0
    if gain >= THRESHOLDS.least_kinds_gain:
        by_chance = np.array(_gains_by_chance(seen, mixtures[0], seed))
        chance = float((1 + (by_chance >= gain).sum()) / (1 + len(by_chance)))
    if chance > THRESHOLDS.most_kinds_chance:
        best = mixtures[0]
    order = np.argsort(-best.member.sum(axis=0), kind="stable")
    member = best.member[:, order]
    sure = member.max(axis=1) >= THRESHOLDS.least_membership
    of_driver = [int(kind) + 1 if is_sure else None for kind, is_sure in zip(member.argmax(axis=1), sure, strict=True)]
    return Kinds(of_driver, [one.evidence for one in mixtures], distinctness, gain, chance)


def seen_of(solver: Solver, fit: Fit) -> Seen:
    """What is known of each driver of a calibrated model, about the mean of its class, car or truck: its standardised
    parameters, in the directions in which data tell most of them and least, and its noise.

    A direction stands for what is known together: gaps at usual speeds, and not time gap and jam gap, which trade.
    """
    state = fit.state
    assert state.sums is not None
    own = slice(0, state.z.shape[1])
    information = state.sums.gram[:, own, own] / state.variances[:, None, None]
    slope = state.sums.gradient[:, own] / state.variances[:, None]
    away = state.away
    n, size = away.shape
    # Each driver counts alike: with the share of its spread that its data tell.
    told = np.linalg.solve(information + state.precision, information).mean(axis=0)
    _, directions = np.linalg.eigh((told + told.T) / 2)
    best = away - np.linalg.solve(information + HARDLY_KNOWN * np.eye(size), slope[:, :, None])[:, :, 0]
    best = np.clip(best @ directions, -FARTHEST, FARTHEST)
    values, known = _noise_of_drivers(solver, fit)
    whole = np.zeros((n, size + 2, size + 2))
    whole[:, own, own] = np.einsum("ji,njk,kl->nil", directions, information, directions)
    for k in range(2):
        whole[:, size + k, size + k] = known[:, k]
    return Seen(whole, np.einsum("nij,nj->ni", whole, np.concatenate([best, values], axis=1)))


def purity(kinds: Sequence[int | None], labels: Sequence[str | None], seed: int) -> dict[str, float] | None:
    """Share of drivers whose label is the most common one of their kind, and what chance makes of it [-]; None where
    fewer than two labels are known.
    """
    known = [(kind, label) for kind, label in zip(kinds, labels, strict=True) if kind is not None and label is not None]
    if len({label for _, label in known}) < 2:
        return None
    _, kind = np.unique([kind for kind, _ in known], return_inverse=True)
    _, label = np.unique([label for _, label in known], return_inverse=True)

    def share(of: np.ndarray) -> float:
        counts = np.zeros((kind.max() + 1, of.max() + 1))
        np.add.at(counts, (kind, of), 1)
        return float(counts.max(axis=1).sum() / len(of))

    rng = np.random.default_rng(seed)
    return {"value": share(label), "by_chance": float(np.mean([share(rng.permutation(label)) for _ in range(DRAWS)]))}


def _are_kinds(mixture: Mixture, distinctness: float) -> bool:
    """True if every population has enough drivers and would hardly be taken for another."""
    if len(mixture.share) == 1:
        return True
    sizes = np.bincount(mixture.member.argmax(axis=1), minlength=len(mixture.share))
    return bool(sizes.min() >= THRESHOLDS.least_drivers and distinctness >= THRESHOLDS.least_distinctness)


def _gains_by_chance(seen: Seen, single: Mixture, seed: int) -> list[float]:
    """Evidence for two kinds above that for one [nats] in data sets of one; 0 where two are no kinds."""
    gains = []
    for replicate in range(REPLICATES):
        drawn = drawn_from(seen, single, np.random.default_rng([seed, replicate]))
        alone = one_group(drawn)
        two = split_further(drawn, alone)
        gains.append(max(0.0, two.evidence - alone.evidence) if _are_kinds(two, two.distinctness()) else 0.0)
    return gains


def _noise_of_drivers(solver: Solver, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of the size of each driver's noise and of the time it lasts, over the usual ones, and what is known of
    them: where its innovations are likeliest among FACTORS, and how fast they become less likely.
    """
    noise, data = fit.noise, fit.state.data
    looks = slice(None, None, data.stride)
    weight = (data.weight[looks] > 0) * noise.independent
    unequal = 1 + noise.growth * unrest(data)[looks]

    def likely(other: Noise) -> np.ndarray:
        gain = other.gain(data.dt, data.stride)
        (innovation,) = solver.innovations([fit.state], gain)
        square = np.minimum(innovation[looks] ** 2 / unequal / gain.variance, LARGEST**2)
        by_piece = -0.5 * ((square + np.log(gain.variance)) * weight).sum(axis=0)
        return np.bincount(data.driver, by_piece, data.n_drivers)

    sizes = np.stack([likely(replace(noise, acceleration=noise.acceleration * factor)) for factor in FACTORS])
    times = np.stack([likely(replace(noise, time=noise.time * factor)) for factor in FACTORS])
    (size, of_size), (time, of_time) = _tops(sizes), _tops(times)
    return np.stack([size, time], axis=1), np.stack([of_size, of_time], axis=1)


def _tops(likely: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where log-likelihoods over FACTORS are largest, as logarithms of the factor, and their curvature there."""
    step, drivers = float(np.log(FACTORS[1] / FACTORS[0])), np.arange(likely.shape[1])
    middle = np.clip(likely.argmax(axis=0), 1, len(FACTORS) - 2)
    below, here, above = (likely[middle + k, drivers] for k in (-1, 0, 1))
    curvature = np.maximum(2 * here - below - above, 0.0) / step**2
    away = np.clip((above - below) / (2 * step) / np.maximum(curvature, HARDLY_KNOWN), -step, step)
    return np.log(FACTORS)[middle] + away, curvature

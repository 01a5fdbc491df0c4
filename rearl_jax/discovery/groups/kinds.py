"""Kinds of drivers, found without labels from their calibrated parameters and their acceleration noise.

Every driver is calibrated under one model. Mixtures of populations are fitted to the estimated parameters and to the
standard deviation and correlation time of the noise (automated vehicles drive more smoothly). The number of kinds is
that of the mixture with the largest evidence whose populations are distinct and have enough drivers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rearl_jax.discovery.groups.mixture import DriverLikelihoods, Mixture, drawn_from, one_group, split_further
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.observer import squared_leader_acceleration
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.thresholds import THRESHOLDS

MOST_KINDS = 6
"""Largest number of kinds that is tested."""

HOPELESS = 10.0
"""Evidence [nats] below the largest so far at which no larger number of kinds is tested."""

REPLICATES = 39
"""Simulated data sets with a single kind; they show how often chance gives as much evidence for two kinds."""

FACTORS = 2.0 ** np.arange(-4, 4)
"""Tested multiples of the population's noise level and of its correlation time [-]."""

FARTHEST = 4.0
"""Bound of a driver's parameters, in standard deviations from the mean [-]: further out the likelihood is not
quadratic, as this method assumes.
"""

HARDLY_KNOWN = 0.1
"""Information that the population mean counts as [-]; drivers with less information of their own are put near it."""

LARGEST = 4.0
"""Innovations are clipped to this number of standard deviations [-]."""

DRAWS = 200
"""Random assignments over which the purity by chance is averaged."""


@dataclass(frozen=True)
class Kinds:
    """Kinds of drivers.

    Attributes:
        of_driver: Number of each driver's kind, from 1 for the largest kind; None if it is uncertain.
        evidence: Log-likelihood of each mixture less its complexity penalty [nats], from one kind on.
        distinctness: Distinctness of each mixture, see `Mixture.distinctness`.
        gain: Evidence for the best mixture of several kinds minus the evidence for one kind [nats].
        chance: Share of simulated single-kind data sets with at least this gain [-].
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
        """The kinds as in verdict.json."""
        return {
            "kinds": self.n,
            "evidence": list(map(float, self.evidence)),
            "distinctness": self.distinctness,
            "gain": float(self.gain),
            "chance": self.chance,
            "uncertain": sum(kind is None for kind in self.of_driver),
        }


def kinds_of(likelihoods: DriverLikelihoods, seed: int) -> Kinds:
    """Kinds of drivers; more than one only if simulated single-kind data rarely give as much evidence for several."""
    mixtures = [one_group(likelihoods)]
    distinctness = [1.0]
    while len(mixtures) < MOST_KINDS and len(likelihoods.weighted) >= (len(mixtures) + 1) * THRESHOLDS.least_drivers:
        mixtures.append(split_further(likelihoods, mixtures[-1]))
        distinctness.append(mixtures[-1].distinctness())
        if mixtures[-1].evidence < max(mixture.evidence for mixture in mixtures) - HOPELESS:
            break
    best = max(
        (mixture for mixture, distinct in zip(mixtures, distinctness, strict=True) if _are_kinds(mixture, distinct)),
        key=lambda mixture: mixture.evidence,
    )
    gain = best.evidence - mixtures[0].evidence
    chance = 1.0
    if gain >= THRESHOLDS.least_kinds_gain:
        by_chance = np.array(_gains_by_chance(likelihoods, mixtures[0], seed))
        chance = float((1 + (by_chance >= gain).sum()) / (1 + len(by_chance)))
    if chance > THRESHOLDS.most_kinds_chance:
        best = mixtures[0]
    order = np.argsort(-best.member.sum(axis=0), kind="stable")
    member = best.member[:, order]
    is_member = member.max(axis=1) >= THRESHOLDS.least_membership
    of_driver = [
        int(kind) + 1 if is_sure else None for kind, is_sure in zip(member.argmax(axis=1), is_member, strict=True)
    ]
    return Kinds(of_driver, [mixture.evidence for mixture in mixtures], distinctness, gain, chance)


def driver_likelihoods(solver: Solver, fit: Fit) -> DriverLikelihoods:
    """Estimates of each driver of a calibrated model, relative to the mean of its class (car or truck): standardised
    parameters, in principal directions of the information, and noise.

    A direction combines parameters that are only known in combination: the gap at typical speeds, for example, is known
    well, while time gap and jam gap can compensate for each other.
    """
    state = fit.state
    assert state.sums is not None
    own = slice(0, state.z.shape[1])
    information = state.sums.gram[:, own, own] / state.variances[:, None, None]
    slope = state.sums.gradient[:, own] / state.variances[:, None]
    away = state.away
    n, size = away.shape
    # Equal weight for each driver: the share of the spread that its data determine.
    determined = np.linalg.solve(information + state.precision, information).mean(axis=0)
    _, directions = np.linalg.eigh((determined + determined.T) / 2)
    best = away - np.linalg.solve(information + HARDLY_KNOWN * np.eye(size), slope[:, :, None])[:, :, 0]
    best = np.clip(best @ directions, -FARTHEST, FARTHEST)
    values, known = _noise_of_drivers(solver, fit)
    joint = np.zeros((n, size + 2, size + 2))
    joint[:, own, own] = np.einsum("ji,njk,kl->nil", directions, information, directions)
    for k in range(2):
        joint[:, size + k, size + k] = known[:, k]
    return DriverLikelihoods(joint, np.einsum("nij,nj->ni", joint, np.concatenate([best, values], axis=1)))


def purity(kinds: Sequence[int | None], labels: Sequence[str | None], seed: int) -> dict[str, float] | None:
    """Share of drivers with the most common label of their kind, and the share expected by chance [-]; None if fewer
    than two labels are known.
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
    """True if every population has enough drivers and is distinct from the others."""
    if len(mixture.share) == 1:
        return True
    sizes = np.bincount(mixture.member.argmax(axis=1), minlength=len(mixture.share))
    return bool(sizes.min() >= THRESHOLDS.least_drivers and distinctness >= THRESHOLDS.least_distinctness)


def _gains_by_chance(likelihoods: DriverLikelihoods, single: Mixture, seed: int) -> list[float]:
    """Evidence for two kinds minus that for one [nats] in simulated single-kind data sets; 0 if the two are not
    distinct.
    """
    gains = []
    for replicate in range(REPLICATES):
        drawn = drawn_from(likelihoods, single, np.random.default_rng([seed, replicate]))
        alone = one_group(drawn)
        two = split_further(drawn, alone)
        gains.append(max(0.0, two.evidence - alone.evidence) if _are_kinds(two, two.distinctness()) else 0.0)
    return gains


def _noise_of_drivers(solver: Solver, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of each driver's noise level and correlation time relative to the population, and their information:
    the maximum of the likelihood over FACTORS and its curvature.
    """
    noise, data = fit.noise, fit.state.data
    independent = slice(None, None, data.stride)
    weight = (data.weight[independent] > 0) * noise.independent
    unequal = 1 + noise.growth * squared_leader_acceleration(data)[independent]

    def log_likelihoods(other: Noise) -> np.ndarray:
        gain = other.gain(data.dt, data.stride)
        (innovation,) = solver.innovations([fit.state], gain)
        square = np.minimum(innovation[independent] ** 2 / unequal / gain.variance, LARGEST**2)
        by_piece = -0.5 * ((square + np.log(gain.variance)) * weight).sum(axis=0)
        return np.bincount(data.driver, by_piece, data.n_drivers)

    sizes = np.stack([log_likelihoods(replace(noise, acceleration=noise.acceleration * factor)) for factor in FACTORS])
    times = np.stack([log_likelihoods(replace(noise, time=noise.time * factor)) for factor in FACTORS])
    (size, of_size), (time, of_time) = _tops(sizes), _tops(times)
    return np.stack([size, time], axis=1), np.stack([of_size, of_time], axis=1)


def _tops(log_likelihoods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Maxima of log-likelihoods over FACTORS, as logarithms of the factor, and the curvature there."""
    step, drivers = float(np.log(FACTORS[1] / FACTORS[0])), np.arange(log_likelihoods.shape[1])
    middle = np.clip(log_likelihoods.argmax(axis=0), 1, len(FACTORS) - 2)
    below, here, above = (log_likelihoods[middle + k, drivers] for k in (-1, 0, 1))
    curvature = np.maximum(2 * here - below - above, 0.0) / step**2
    away = np.clip((above - below) / (2 * step) / np.maximum(curvature, HARDLY_KNOWN), -step, step)
    return np.log(FACTORS)[middle] + away, curvature

"""Kinds of drivers, found without labels from their calibrated parameters and their acceleration noise.

Every driver is calibrated under one model. Mixtures of populations are fitted to the estimated parameters and to the
standard deviation and correlation time of the noise (automated vehicles drive more smoothly). The number of kinds is
that of the mixture with the largest evidence whose populations hardly overlap and have enough drivers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.groups.mixture import DriverLikelihoods, Mixture, drawn_from, one_group, split_further
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import with_prior
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.observer import relative_variance
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.thresholds import THRESHOLDS

MOST_KINDS = 6
"""Largest number of kinds that is tested."""

LARGEST_LOSS = 10.0
"""Evidence [nats] below the largest so far at which no larger number of kinds is tested."""

REPLICATES = 39
"""Simulated data sets with a single kind; they show how often chance gives as much evidence for two kinds."""

FACTORS = 2.0 ** np.arange(-4, 4)
"""Tested multiples of the population's noise level and of its correlation time [-]."""

PARAMETER_BOUND = 4.0
"""Bound of a driver's parameters, in standard deviations from the mean [-]: beyond it the log-likelihood is not
quadratic, as this method assumes.
"""

MEAN_INFORMATION = 0.1
"""Information that the population mean counts as [-]; drivers whose data contain less are put near the mean."""

INNOVATION_BOUND = 4.0
"""Innovations are clipped to this number of standard deviations [-]."""

DRAWS = 200
"""Random assignments of labels to drivers over which the purity by chance is averaged."""


@dataclass(frozen=True)
class Kinds:
    """Kinds of drivers.

    Attributes:
        of_driver: Number of each driver's kind, from 1 for the largest kind; None if it is uncertain.
        evidence: Log-likelihood of each mixture less its complexity penalty [nats], from one kind on.
        distinctness: Distinctness of each mixture, see `Mixture.distinctness`.
        gain: Evidence for the best mixture of several kinds minus the evidence for one kind [nats].
        chance: Share of single-kind data sets in which two kinds have at least this gain, from REPLICATES simulated
            ones and the data themselves [-]; 1 if the gain is too small anyway.
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
    """Kinds of drivers; several only if simulated single-kind data rarely give as much evidence for several."""
    mixtures = [one_group(likelihoods)]
    distinctness = [1.0]
    while len(mixtures) < MOST_KINDS and len(likelihoods.weighted) >= (len(mixtures) + 1) * THRESHOLDS.least_drivers:
        mixtures.append(split_further(likelihoods, mixtures[-1]))
        distinctness.append(mixtures[-1].distinctness())
        if mixtures[-1].evidence < max(mixture.evidence for mixture in mixtures) - LARGEST_LOSS:
            break
    best = max(
        (mixture for mixture, distinct in zip(mixtures, distinctness, strict=True) if _are_kinds(mixture, distinct)),
        key=lambda mixture: mixture.evidence,
    )
    gain = best.evidence - mixtures[0].evidence
    chance = 1.0
    if gain >= THRESHOLDS.least_kinds_gain:
        gains = np.array(_gains_by_chance(likelihoods, mixtures[0], seed))
        chance = float((1 + (gains >= gain).sum()) / (1 + len(gains)))
    if chance > THRESHOLDS.most_kinds_chance:
        best = mixtures[0]
    order = np.argsort(-best.member.sum(axis=0), kind="stable")
    member = best.member[:, order]
    is_certain = member.max(axis=1) >= THRESHOLDS.least_membership
    of_driver = [int(kind) + 1 if sure else None for kind, sure in zip(member.argmax(axis=1), is_certain, strict=True)]
    return Kinds(of_driver, [mixture.evidence for mixture in mixtures], distinctness, gain, chance)


def driver_likelihoods(solver: Solver, fit: Fit) -> DriverLikelihoods:
    """Likelihood of each driver's parameters: the standardised ones relative to the mean of its class (car or truck),
    in principal directions of the information, and the logarithms of its noise level and correlation time.

    A direction combines parameters that are only known in combination: the gap at typical speeds, for example, is known
    well, while time gap and jam gap can compensate for each other.
    """
    state = fit.state
    assert state.sums is not None
    calibrated = slice(0, state.z.shape[1])
    information = state.own_information
    slope = state.sums.gradient[:, calibrated] / state.variances[:, None]
    away = state.away
    n, size = away.shape
    # Equal weight for each driver: the share of the spread between drivers that its data determine.
    determined = np.linalg.solve(with_prior(information, state.precision), information).mean(axis=0)
    _, directions = np.linalg.eigh((determined + determined.T) / 2)
    estimate = away - np.linalg.solve(information + MEAN_INFORMATION * np.eye(size), slope[:, :, None])[:, :, 0]
    estimate = np.clip(estimate @ directions, -PARAMETER_BOUND, PARAMETER_BOUND)
    of_noise, noise_information = _noise_of_drivers(solver, fit)
    joint = np.zeros((n, size + 2, size + 2))
    joint[:, calibrated, calibrated] = np.einsum("ji,njk,kl->nil", directions, information, directions)
    for k in range(2):
        joint[:, size + k, size + k] = noise_information[:, k]
    return DriverLikelihoods(joint, np.einsum("nij,nj->ni", joint, np.concatenate([estimate, of_noise], axis=1)))


def purity(kinds: Sequence[int | None], labels: Sequence[str | None], seed: int) -> dict[str, float] | None:
    """Share of drivers with the most common label of their kind (`value`), and the share expected by chance
    (`by_chance`) [-]; None if fewer than two labels are known.
    """
    known = [(kind, label) for kind, label in zip(kinds, labels, strict=True) if kind is not None and label is not None]
    if len({label for _, label in known}) < 2:
        return None
    _, kind = np.unique([kind for kind, _ in known], return_inverse=True)
    _, label = np.unique([label for _, label in known], return_inverse=True)

    def share(label: np.ndarray) -> float:
        counts = np.zeros((kind.max() + 1, label.max() + 1))
        np.add.at(counts, (kind, label), 1)
        return float(counts.max(axis=1).sum() / len(label))

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
    """Logarithms of each driver's noise level and correlation time relative to the population's, where the likelihood
    over FACTORS has its maximum, and their information, the curvature there.
    """
    noise, data = fit.noise, fit.state.data
    measured = slice(None, None, data.stride)  # time steps with an independent measurement
    weight = (data.weight[measured] > 0) * noise.independent
    variance = relative_variance(data, noise)[measured]

    def log_likelihoods(tested: Noise) -> np.ndarray:
        gain = tested.gain(data.dt, data.stride)
        (innovation,) = solver.innovations([fit.state], gain)
        square = np.minimum(innovation[measured] ** 2 / variance / gain.variance, INNOVATION_BOUND**2)
        by_piece = -0.5 * ((square + np.log(gain.variance)) * weight).sum(axis=0)
        return np.bincount(data.driver, by_piece, data.n_drivers)

    sizes = np.stack([log_likelihoods(replace(noise, acceleration=noise.acceleration * factor)) for factor in FACTORS])
    times = np.stack([log_likelihoods(replace(noise, time=noise.time * factor)) for factor in FACTORS])
    (size, size_information), (time, time_information) = _maxima(sizes), _maxima(times)
    return np.stack([size, time], axis=1), np.stack([size_information, time_information], axis=1)


def _maxima(log_likelihoods: Float[np.ndarray, "factors drivers"]) -> tuple[np.ndarray, np.ndarray]:
    """Logarithm of the factor at which each driver's log-likelihood has its maximum, and the curvature there (parabola
    through the three values around the largest).
    """
    step, drivers = float(np.log(FACTORS[1] / FACTORS[0])), np.arange(log_likelihoods.shape[1])
    middle = np.clip(log_likelihoods.argmax(axis=0), 1, len(FACTORS) - 2)
    below, here, above = (log_likelihoods[middle + k, drivers] for k in (-1, 0, 1))
    curvature = np.maximum(2 * here - below - above, 0.0) / step**2
    away = np.clip((above - below) / (2 * step) / np.maximum(curvature, MEAN_INFORMATION), -step, step)
    return np.log(FACTORS)[middle] + away, curvature

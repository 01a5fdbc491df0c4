"""Mixtures of populations of drivers whose parameters are estimated with known errors.

The likelihood of the parameters of driver i is Gaussian: J_i is its information (inverse covariance of the estimate),
and h_i is J_i times the estimate. A driver without data has J_i = 0 and does not affect the populations. Populations
are Gaussian. They differ in the means of some parameters and share the means of the others, which then carry no
complexity penalty. The covariance of a population is the common covariance times a factor of its own, because people
differ more than automated vehicles.

Source: expectation maximisation with errors of measurement, Bovy, Hogg & Roweis, Ann. Appl. Stat. 5 (2011) 1657; common
shape with own volume, Celeux & Govaert, Pattern Recognit. 28 (1995) 781; choice of the differing parameters, Raftery &
Dean, J. Am. Stat. Assoc. 101 (2006) 168; evidence by Schwarz, Ann. Stat. 6 (1978) 461.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

ITERATIONS, NEARBY = 60, 12
"""Maximum number of iterations from a new start, and from a mixture in which one parameter was changed."""

TOLERANCE = 0.02
"""Rise of the log-likelihood below which the search ends [nats]."""

USUAL_DRIVERS = 20.0
"""Weight of the prior covariance (unit matrix of standardised parameters), in drivers: parameters that data hardly
determine must not get a small or large spread by accident.
"""

PRIOR_DRIVERS = 4.0
"""Weight, in drivers, of the prior that the factor of a population's covariance is 1."""

DRAWN = 4000
"""Number of drivers drawn from each population, to estimate how often drivers are assigned to their own population."""


@dataclass(frozen=True)
class DriverLikelihoods:
    """Gaussian likelihood of each driver's parameters.

    Attributes:
        information: J, the inverse of the covariance of the estimate; 0 without data.
        weighted: h, the information times the estimate.
    """

    information: Float[np.ndarray, "drivers parameters parameters"]
    weighted: Float[np.ndarray, "drivers parameters"]


@dataclass(frozen=True)
class Mixture:
    """Populations fitted to drivers.

    Attributes:
        share: Share of the drivers in each population [-].
        mean: Mean parameters of each population.
        covariance: Covariance of each population.
        differing: Indices of the parameters in which means differ.
        log_likelihood: Log-likelihood of all drivers, less a constant that is the same for all mixtures [nats].
        member: Probability that a driver belongs to a population [-].
        expected: Posterior mean of a driver's parameters if it belongs to that population.
    """

    share: Float[np.ndarray, " groups"]
    mean: Float[np.ndarray, "groups parameters"]
    covariance: Float[np.ndarray, "groups parameters parameters"]
    differing: tuple[int, ...]
    log_likelihood: float
    member: Float[np.ndarray, "drivers groups"]
    expected: Float[np.ndarray, "groups drivers parameters"]

    @property
    def evidence(self) -> float:
        """Log-likelihood less the complexity penalty of the fitted parameters [nats]."""
        n_groups, size = self.mean.shape
        # Common covariance and mean; then share, factor of the covariance and differing means of each further group.
        n_fitted = size * (size + 1) / 2 + size + (n_groups - 1) * (2 + len(self.differing))
        return self.log_likelihood - 0.5 * n_fitted * np.log(len(self.member))

    def distinctness(self) -> float:
        """Smallest share of a population's drivers who would be assigned to it if their parameters were known exactly
        [-].

        Two halves of one skewed or wide population overlap; distinct kinds do not.
        """
        rng, least = np.random.default_rng(0), 1.0
        for k in range(len(self.share)):
            deviation = rng.multivariate_normal(self.mean[k], self.covariance[k], DRAWN)[:, None] - self.mean
            distance = np.einsum("nki,kij,nkj->nk", deviation, np.linalg.inv(self.covariance), deviation)
            log_density = np.log(self.share) - 0.5 * distance - 0.5 * np.linalg.slogdet(self.covariance)[1]
            least = min(least, float((log_density.argmax(axis=1) == k).mean()))
        return least


def one_group(likelihoods: DriverLikelihoods) -> Mixture:
    """All drivers as one population."""
    return _maximised(likelihoods, np.ones((len(likelihoods.weighted), 1)), (), spread_of_all(likelihoods))


def split_further(likelihoods: DriverLikelihoods, mixture: Mixture) -> Mixture:
    """The best mixture with one more population; the same mixture if no population can be split.

    The search starts with each population split at the mean of each parameter. Means first differ in that parameter
    alone, and further parameters are added while the evidence rises; a second search starts with all parameters
    differing and removes them while the evidence rises. Each of the two finds kinds that the other misses.
    """
    pooled, indices = spread_of_all(likelihoods), range(likelihoods.weighted.shape[1])
    one_differs, all_differ = [], []
    for k in range(len(mixture.share)):
        weights = mixture.member[:, k]
        for index in indices:
            values = mixture.expected[k][:, index]
            is_above = (values > np.average(values, weights=weights)).astype(float)
            member = np.column_stack(
                [np.delete(mixture.member, k, axis=1), weights * is_above, weights * (1 - is_above)]
            )
            if member.sum(axis=0).min() >= 1.0:
                one_differs.append(_maximised(likelihoods, member, {*mixture.differing, index}, pooled))
                all_differ.append(_maximised(likelihoods, member, indices, pooled))
    if not one_differs:
        return mixture
    results = (
        _improved(likelihoods, max(starts, key=lambda candidate: candidate.evidence), pooled)
        for starts in (one_differs, all_differ)
    )
    return max(results, key=lambda candidate: candidate.evidence)


def _improved(likelihoods: DriverLikelihoods, mixture: Mixture, pooled: np.ndarray) -> Mixture:
    """The mixture after adding or removing differing parameters, one at a time, while the evidence rises."""
    while True:
        one_changed = [{*mixture.differing} ^ {index} for index in range(len(pooled))]
        tried = [_maximised(likelihoods, mixture.member, indices, pooled, NEARBY) for indices in one_changed if indices]
        best = max(tried, key=lambda candidate: candidate.evidence, default=mixture)
        if best.evidence <= mixture.evidence:
            return mixture
        mixture = best


def drawn_from(likelihoods: DriverLikelihoods, mixture: Mixture, rng: np.random.Generator) -> DriverLikelihoods:
    """Simulated drivers of a mixture, with the same information as the given ones."""
    groups = rng.choice(len(mixture.share), len(likelihoods.weighted), p=mixture.share)
    roots = np.linalg.cholesky(mixture.covariance)
    parameters = mixture.mean[groups] + np.einsum(
        "nij,nj->ni", roots[groups], rng.standard_normal(likelihoods.weighted.shape)
    )
    values, vectors = np.linalg.eigh(likelihoods.information)
    noise = np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(likelihoods.weighted.shape)
    errors = np.einsum("nij,nj->ni", vectors, noise)  # of h, whose covariance is J
    return DriverLikelihoods(
        likelihoods.information, np.einsum("nij,nj->ni", likelihoods.information, parameters) + errors
    )


def spread_of_all(likelihoods: DriverLikelihoods) -> Float[np.ndarray, "parameters parameters"]:
    """Covariance of all drivers as one population; the search starts at the unit matrix."""
    size = likelihoods.weighted.shape[1]
    mean, covariance = np.zeros(size), np.eye(size)
    for _ in range(ITERATIONS):
        expected, error, _ = _posterior(likelihoods, mean, covariance)
        mean = expected.mean(axis=0)
        away = expected - mean
        covariance = away.T @ away + error.sum(axis=0) + USUAL_DRIVERS * np.eye(size)
        covariance = covariance / (len(away) + USUAL_DRIVERS)
    return covariance


def _posterior(
    likelihoods: DriverLikelihoods, mean: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Posterior mean and covariance of each driver's parameters in a population, and log-likelihood of the driver there
    [nats].
    """
    precision = np.linalg.inv(covariance)
    posterior_precision = likelihoods.information + precision
    error = np.linalg.inv(posterior_precision)
    right = likelihoods.weighted + precision @ mean
    expected = np.einsum("nij,nj->ni", error, right)
    square = np.einsum("ni,ni->n", expected, right) - mean @ precision @ mean
    log_likelihood = 0.5 * (square - np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(posterior_precision)[1])
    return expected, error, log_likelihood


def _maximised(
    likelihoods: DriverLikelihoods,
    member: np.ndarray,
    differing: Collection[int],
    pooled: np.ndarray,
    iterations: int = ITERATIONS,
) -> Mixture:
    """The mixture found by expectation maximisation, from start values of `Mixture.member`.

    `differing` are the indices of the parameters in which means may differ, `pooled` is the covariance of all drivers.
    """
    n_groups, size, indices = member.shape[1], len(pooled), tuple(sorted(differing))
    mean, covariance, shape = np.zeros((n_groups, size)), np.stack([pooled] * n_groups), pooled
    posteriors = [_posterior(likelihoods, np.zeros(size), pooled)] * n_groups
    reached = -np.inf
    for _ in range(iterations):
        counts = member.sum(axis=0)
        unconstrained = np.stack([member[:, k] @ posteriors[k][0] / counts[k] for k in range(n_groups)])
        mean = _constrained(unconstrained, counts, covariance, indices)
        scatter = np.empty_like(covariance)
        for k, (expected, error, _) in enumerate(posteriors):
            away = expected - mean[k]
            scatter[k] = (member[:, k, None] * away).T @ away + np.tensordot(member[:, k], error, 1)
        factor = np.ones(n_groups)
        if n_groups > 1:
            excess = np.einsum("ij,kji->k", np.linalg.inv(shape), scatter) / size
            factor = (excess + PRIOR_DRIVERS) / (counts + PRIOR_DRIVERS)
        shape = (scatter / factor[:, None, None]).sum(axis=0) + USUAL_DRIVERS * np.eye(size)
        shape = shape / (counts.sum() + USUAL_DRIVERS)
        covariance = factor[:, None, None] * shape
        posteriors = [_posterior(likelihoods, mean[k], covariance[k]) for k in range(n_groups)]
        share = counts / counts.sum()
        log_joint = np.stack([posterior[2] for posterior in posteriors], axis=1) + np.log(share)
        total = np.logaddexp.reduce(log_joint, axis=1)
        member, previous, reached = np.exp(log_joint - total[:, None]), reached, float(total.sum())
        if reached < previous + TOLERANCE or member.sum(axis=0).min() < 1.0:
            break
    expected = np.stack([posterior[0] for posterior in posteriors])
    return Mixture(share, mean, covariance, indices, reached, member, expected)


def _constrained(
    unconstrained: Float[np.ndarray, "groups parameters"],
    counts: Float[np.ndarray, " groups"],
    covariance: Float[np.ndarray, "groups parameters parameters"],
    differing: Sequence[int],
) -> Float[np.ndarray, "groups parameters"]:
    """Means of the populations, of sizes `counts`, equal except in the `differing` parameters: weighted least squares
    from unconstrained means.
    """
    n_groups, size = unconstrained.shape
    if n_groups == 1 or len(differing) == size:
        return unconstrained
    n_free = len(differing)
    design = np.zeros((n_groups, size, size + (n_groups - 1) * n_free))
    design[:, :, :size] = np.eye(size)
    for k in range(n_groups - 1):
        design[k, list(differing), size + k * n_free + np.arange(n_free)] = 1.0
    weighted = np.einsum("kij,kil->kjl", design, np.linalg.inv(covariance) * counts[:, None, None])
    left, right = np.einsum("kjl,klm->jm", weighted, design), np.einsum("kjl,kl->j", weighted, unconstrained)
    return design @ np.linalg.solve(left, right)

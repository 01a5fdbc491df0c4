"""Covariance of fitted parameters, and complexity penalties. theta are the parameters of all candidates."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.stats import norm

from rearl_jax.discovery.observe.candidates import FLAT
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.projection import mean_projections, own_projection
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.thresholds import THRESHOLDS

NEAR = 1e-6
"""Distance from a bound below which a parameter counts as at the bound [-]."""

LOG_OBSERVATIONS = np.log(THRESHOLDS.independent_observations)
"""Logarithm of a typical number of independent observations of one parameter [-]."""


def covariance(solver: Solver, state: FitState) -> Float[np.ndarray, "free free"]:
    """Covariance of the searched elements of theta in a solved state, in order.

    Correlations follow from the curvature. Of each standard deviation the larger of two estimates is used: from the
    curvature, which relies on the noise model, and from the sandwich formula, which uses the scatter of the drivers'
    scores, corrected for the number of drivers.

    Source: White, Econometrica 50 (1982) 1 (sandwich); Cameron & Miller, J. Human Resources 50 (2015) 317, equation 12
    (the correction; the number of parameters counts beside that of observations, not of drivers).
    """
    assert state.sums is not None
    free = solver.free(state)
    if not len(free):
        return np.empty((0, 0))
    scores, information = _projected(solver, state)
    information = information + np.diag(solver.layout.scale[free] ** -2.0)
    by_curvature = np.linalg.pinv(information)
    scores = scores - scores.mean(axis=0)
    n = len(scores)
    scatter = scores.T @ scores * n / max(n - 1, 1)
    sandwich = by_curvature @ scatter @ by_curvature
    widening = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(by_curvature), 1.0))
    return by_curvature * np.outer(widening, widening)


def shares_at_bound(solver: Solver, state: FitState) -> Float[np.ndarray, " own"]:
    """Share of the drivers at a bound of each parameter [-]."""
    low, high = (bound[state.truck] for bound in solver.layout.prior.bounds)
    return ((state.z <= low + NEAR) | (state.z >= high - NEAR)).mean(axis=0)


def _projected(
    solver: Solver, state: FitState
) -> tuple[Float[np.ndarray, "drivers free"], Float[np.ndarray, "free free"]]:
    """Each driver's score of the searched elements of theta and the information on them that remain when the drivers'
    own parameters and the means of their population are fitted (Schur complements).
    """
    assert state.sums is not None
    n_own = state.z.shape[1]
    gradient, gram = state.sums.gradient / state.variances[:, None], state.sums.gram / state.variances[:, None, None]
    own = own_projection(state, gradient, gram[:, :n_own])
    scores = own.gradient.copy()
    information = (gram[:, n_own:, n_own:] - np.einsum("dij,dik->djk", own.coupling, own.response)).sum(axis=0)
    for mean in mean_projections(state, solver.layout.prior, own):
        scores[mean.members] -= mean.driver_pull @ mean.answer
        information -= mean.coupled.T @ mean.answer
    return scores, information


def complexity_penalty(solver: Solver, state: FitState, places: Sequence[int]) -> float:
    """Complexity penalty of the elements of theta with the indices `places` [nats]: it grows with how much the data
    narrow their prior, and with their distance from its mean.

    Source: Laplace approximation of the evidence, MacKay, Neural Comput. 4 (1992) 415; for uninformative priors, half
    the logarithm of the number of independent observations, Schwarz, Ann. Stat. 6 (1978) 461.
    """
    layout, free = solver.layout, solver.free(state)
    _, information = _projected(solver, state)
    scale = layout.scale[free]
    chosen = np.isin(free, list(places))
    has_prior = chosen & (scale < FLAT)
    sd = scale[has_prior]
    inner = np.eye(len(sd)) + sd[:, None] * information[np.ix_(has_prior, has_prior)] * sd[None, :]
    off = (state.theta - layout.reference)[free][has_prior] / sd
    n_without_prior = int((chosen & ~has_prior).sum())
    return float(0.5 * np.linalg.slogdet(inner)[1] + 0.5 * (off**2).sum() + 0.5 * n_without_prior * LOG_OBSERVATIONS)


def interval(value: float, deviation: float, confidence: float) -> tuple[float, float]:
    """The central interval of a Gaussian with this mean, standard deviation and probability `confidence`."""
    half = float(norm.ppf(0.5 + confidence / 2)) * deviation
    return value - half, value + half

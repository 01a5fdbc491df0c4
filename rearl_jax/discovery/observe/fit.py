"""A fitted model, and its application to other drivers."""

from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.discovery.observe.candidates import Candidate
from rearl_jax.discovery.observe.fit_state import FitState, new_state, replaced
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.noise import under_best_noise
from rearl_jax.discovery.observe.observer import pieces_of
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import Split


@dataclass(frozen=True)
class Fit:
    """A model fitted after one candidate was added.

    Attributes:
        candidate: Candidate (effect that may be missing) that was added last; None for the base model.
        state: Parameters and data of the fitted model, all added candidates included.
        noise: Noise re-estimated under this model.
    """

    candidate: Candidate | None
    state: FitState
    noise: Noise


def recalibrated(solver: Solver, data: Measured, fit: Fit) -> FitState:
    """The drivers of `data` under a model fitted to other drivers: own parameters are calibrated, all else is kept.

    All models have the same number of free parameters on these drivers, so their likelihoods are comparable.
    """
    state = new_state(data, solver.layout, fit.noise)
    state.mean, state.theta, state.active = fit.state.mean.copy(), fit.state.theta.copy(), fit.state.active
    state.z, state.spread = state.mean[state.truck], fit.state.spread
    state.variance = fit.state.variance
    state.holds_shared = True
    solver.solve([state], iterations=15, tolerance=0.1)
    return state


def known_drivers(solver: Solver, split: Split, fit: Fit) -> FitState:
    """The test drives of a split, with each driver's parameters and noise level from its training drives."""
    trained = recalibrated(solver, split.training, fit)
    return replaced(trained, data=split.test, pieces=pieces_of(split.test, fit.noise), sums=trained.sums)


def joint_fit(solver: Solver, fit: Fit, data: Measured) -> Fit:
    """The model fitted again to its drivers and those of `data` together, starting from the present fit.

    Many drivers are needed for rare situations, such as the response to a cut-in.
    """
    state = fit.state
    both = new_state(state.data.with_drivers(data), solver.layout, fit.noise)
    both.mean, both.theta, both.active = state.mean.copy(), state.theta, state.active
    both.spread = state.spread
    both.z = np.concatenate([state.z, both.mean[both.truck[state.data.n_drivers :]]])
    solver.solve([both], iterations=15, tolerance=0.3)
    both, noise = under_best_noise(solver, both, fit.noise, iterations=15)
    return replace(fit, state=both, noise=noise)

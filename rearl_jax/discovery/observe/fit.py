"""A fitted model, and the same model on other drivers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.discovery.observe.candidates import Candidate
from rearl_jax.discovery.observe.fit_state import FitState, new_state
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.noise import ACCELERATIONS, noises, under_best_noise
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured


@dataclass(frozen=True)
class Fit:
    """One candidate added to the model and fitted.

    Attributes:
        candidate: What was added last.
        state: With everything that was added.
        noise: Found anew under it.
    """

    candidate: Candidate | None
    state: FitState
    noise: Noise


def on_others(solver: Solver, data: Measured, fits: Sequence[Fit]) -> list[FitState]:
    """Other drivers under fitted models: each finds its own parameters, everything else stays.

    Every model has the same freedom, so likelihoods compare.
    """
    states = []
    for fit in fits:
        state = new_state(data, solver.layout, fit.noise)
        state.mean, state.theta, state.active = fit.state.mean.copy(), fit.state.theta.copy(), fit.state.active
        state.z, state.spread = state.mean[state.truck], fit.state.spread
        state.variance = fit.state.variance
        state.holds_population = state.holds_variance = state.holds_theta = True
        solver.solve([state], iterations=15, tolerance=0.1)
        states.append(state)
    return states


def with_others(solver: Solver, fit: Fit, data: Measured) -> Fit:
    """The fitted drivers and others together, everything found anew from what was fitted.

    What few drivers show at times, such as what follows a cut-in, needs all of them to be seen.
    """
    state = fit.state
    both = new_state(state.data.beside(data), solver.layout, fit.noise)
    both.mean, both.theta, both.active = state.mean.copy(), state.theta, state.active
    both.spread = state.spread
    both.z = np.concatenate([state.z, both.mean[both.truck[state.data.n_drivers :]]])
    solver.solve([both], iterations=15, tolerance=0.3)
    both, noise = under_best_noise(solver, both, noises(fit.noise, ACCELERATIONS), iterations=15)
    return replace(fit, state=both, noise=noise)

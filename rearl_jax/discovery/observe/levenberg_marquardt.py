"""Levenberg-Marquardt search for the best parameters of one fit (`FitState`): its Hessian has one block per driver,
which a Schur complement eliminates. z are the drivers' own parameters, theta those of the candidates.

Every driver has a damping of its own, so that one driver in a strongly nonlinear range does not slow down all others.
Own parameters at a bound stay there and are left out of the step if the objective falls beyond the bound.

Source: Marquardt, SIAM J. Appl. Math. 11 (1963) 431; block elimination as in bundle adjustment, Triggs et al. (2000);
fixed bounds: projected Newton methods, Bertsekas, SIAM J. Control Optim. 20 (1982) 221.
"""

from dataclasses import fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.discovery.observe.candidates import Layout
from rearl_jax.discovery.observe.fit_state import CLASSES, DriverSums, FitState, with_prior

VARIANCE_ITERATIONS = 5
"""Iterations for S_usual, the drivers' common variance, after each step of the other parameters."""

LONGEST_STEP = 1.0
"""Bound of a step of a driver's standardised parameters [-]."""

DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-7, 1e4
"""Damping at the start, lower bound of the damping, and the value at which the search gives up [-]."""

AFTER_SUCCESS, AFTER_FAILURE = 0.2, 8.0
"""Factors of the damping after an accepted and after a rejected step [-]."""

LEAST_STEPS = 3
"""Number of accepted steps before which a small gain does not end the search."""


class LevenbergMarquardt:
    """Search from a state that has been evaluated; the state is changed in place. `free` are the indices of theta that
    the search varies.

    Attributes:
        is_running: Whether the search continues.
    """

    def __init__(self, state: FitState, layout: Layout, free: Int[np.ndarray, " free"]) -> None:
        self.is_running = True
        self._state, self._layout, self._free = state, layout, free
        self._damping = np.full(len(state.z), DAMPING)  # damping of each driver
        self._shared_damping = DAMPING
        self._expected = np.zeros(len(state.z))  # expected gain of each driver in the step to the next point [nats]
        self._n_accepted = 0
        adapt_variance(state)
        state.objective = self._objective(state)

    def next_point(self) -> FitState:
        """The next point to be evaluated.

        The Hessian has one block per driver (own parameters z), a shared block (means of cars and of trucks, then added
        elements of theta), and couplings between both. The drivers' blocks are eliminated, which leaves a small system
        for the shared step (Schur complement); each driver's step then follows from the shared one. The search varies
        theta in steps of `layout.unit`.
        """
        state, layout, free = self._state, self._layout, self._free
        assert state.sums is not None
        n_own, size = layout.prior.size, layout.prior.size + len(free)
        own, added = slice(0, n_own), slice(n_own, size)
        unit, scale = layout.unit[free], layout.scale[free]
        steps = np.concatenate([np.ones(n_own), unit])
        gram = state.sums.gram[:, :size, :size] * (steps[:, None] * steps) / state.variances[:, None, None]
        gradient = state.sums.gradient[:, :size] * steps / state.variances[:, None]
        precision, away = state.precision, state.away @ state.precision
        n_mean = 0 if state.holds_shared else CLASSES * n_own
        n, n_shared = len(state.z), n_mean + len(free)
        own_block = with_prior(gram[:, own, own], precision)
        own_gradient = gradient[:, own] + away
        coupling = np.zeros((n, n_own, n_shared))
        # Shared block and gradient: population means first.
        block, slope = np.zeros((n_shared, n_shared)), np.zeros(n_shared)
        for c in range(CLASSES if n_mean else 0):
            of_mean = slice(c * n_own, (c + 1) * n_own)
            members = state.truck == c
            coupling[members, :, of_mean] = -precision
            block[of_mean, of_mean] = members.sum() * precision + np.diag(layout.prior.location_precision)
            slope[of_mean] = layout.prior.location_precision * state.mean[c] - away[members].sum(axis=0)
        of_theta = slice(n_mean, n_shared)
        coupling[:, :, of_theta] = gram[:, own, added]
        block[of_theta, of_theta] = gram[:, added, added].sum(axis=0) + np.diag((unit / scale) ** 2)
        off = (state.theta - layout.reference)[free]
        slope[of_theta] = gradient[:, added].sum(axis=0) + off * unit / scale**2
        # Parameters that would leave their bounds are taken out of the system.
        low, high = (bound[state.truck] for bound in layout.prior.bounds)
        own_held = _is_held(state.z, own_gradient, low, high)
        own_block, own_gradient = _without(own_held, own_block), own_gradient * ~own_held
        held = np.zeros(n_shared, bool)
        held[of_theta] = _is_held(state.theta[free], slope[of_theta], layout.low[free], layout.high[free])
        block, slope = _without(held, block), slope * ~held
        coupling = coupling * (~own_held[:, :, None] & ~held)
        damped = own_block + self._damping[:, None, None] * np.einsum("dii,ij->dij", own_block, np.eye(n_own))
        solved = np.linalg.solve(damped, np.concatenate([own_gradient[:, :, None], coupling], axis=2))
        step = np.zeros(n_shared)
        if n_shared:
            reduced = block + self._shared_damping * np.diag(np.diag(block))
            reduced = reduced - np.einsum("dij,dik->jk", coupling, solved[:, :, 1:])
            rest = slope - np.einsum("dij,di->j", coupling, solved[:, :, 0])
            step = -np.linalg.solve(reduced + 1e-9 * np.eye(n_shared), rest)
        z_step = np.clip(-(solved[:, :, 0] + solved[:, :, 1:] @ step), -LONGEST_STEP, LONGEST_STEP)
        # Expected fall of each driver's objective, to second order [nats].
        self._expected = -0.5 * (own_gradient * z_step).sum(axis=1)
        theta = state.theta.copy()
        theta[free] += unit * np.clip(step[of_theta], -LONGEST_STEP, LONGEST_STEP)
        mean = state.mean
        if n_mean:
            mean = mean + np.clip(step[:n_mean], -LONGEST_STEP, LONGEST_STEP).reshape(-1, n_own)
        z, theta = np.clip(state.z + z_step, low, high), np.clip(theta, layout.low, layout.high)
        return replace(state, z=z, mean=mean, theta=theta, sums=None)

    def judge(self, trial: FitState, tolerance: float) -> None:
        """Accepts an evaluated point if it is better; a gain below `tolerance` [nats] ends the search."""
        state = self._state
        gained = trial.penalised() - state.penalised()
        if state.holds_shared:
            self._judge_drivers(trial, gained, tolerance)
            return
        self._damping = np.where(
            gained < 0, self._damping * AFTER_FAILURE, np.maximum(self._damping * AFTER_SUCCESS, LEAST_DAMPING)
        )
        before, reached = state.objective, self._objective(trial)
        if reached < before:
            state.z, state.mean, state.theta, state.sums = trial.z, trial.mean, trial.theta, trial.sums
            adapt_variance(state)
            state.objective = self._objective(state)
            self._shared_damping = max(self._shared_damping * AFTER_SUCCESS, LEAST_DAMPING)
            self._n_accepted += 1
            self.is_running = before - reached > tolerance or self._n_accepted < LEAST_STEPS
        else:
            self._shared_damping *= AFTER_FAILURE
            self.is_running = self._shared_damping < MOST_DAMPING

    def _judge_drivers(self, trial: FitState, gained: Float[np.ndarray, " drivers"], tolerance: float) -> None:
        """Accepts the point separately for each driver who improves; only valid if drivers share no free parameters."""
        state, better = self._state, gained > 0
        assert state.sums is not None
        assert trial.sums is not None
        state.z = _where(better, trial.z, state.z)
        state.sums = DriverSums(
            **{
                field.name: _where(better, getattr(trial.sums, field.name), getattr(state.sums, field.name))
                for field in fields(DriverSums)
            }
        )
        adapt_variance(state)
        state.objective = self._objective(state)
        self._damping = np.where(
            better, np.maximum(self._damping * AFTER_SUCCESS, LEAST_DAMPING), self._damping * AFTER_FAILURE
        )
        expected_gain = np.where(
            better, gained, np.where(self._damping < MOST_DAMPING, np.maximum(self._expected, 0.0), 0.0)
        )
        self.is_running = bool(expected_gain.sum() > tolerance)

    def _objective(self, state: FitState) -> float:
        """Objective [nats], at the present S_usual."""
        off = (state.theta - self._layout.reference)[self._free] / self._layout.scale[self._free]
        located = self._layout.prior.location_precision * state.mean**2
        return float(-state.penalised().sum() + 0.5 * located.sum() + 0.5 * (off**2).sum())


def adapt_variance(state: FitState) -> None:
    """Moves S_usual towards its most likely value, the harmonic mean of the drivers' variances."""
    if not state.holds_shared:
        for _ in range(VARIANCE_ITERATIONS):
            state.variance = float(1 / np.mean(1 / state.variances))


def _is_held(values: np.ndarray, slope: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """True if a parameter is at a bound and the objective falls beyond the bound."""
    return ((values <= low) & (slope > 0)) | ((values >= high) & (slope < 0))


def _without(held: Bool[np.ndarray, "*n k"], block: Float[np.ndarray, "*n k k"]) -> Float[np.ndarray, "*n k k"]:
    """Second derivatives with the held parameters decoupled from all others."""
    moves = ~held
    return block * (moves[..., :, None] & moves[..., None, :]) + held[..., None] * np.eye(held.shape[-1])


def _where(chosen: Bool[np.ndarray, " drivers"], first: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Rows of the first array for chosen drivers, else of the second."""
    return np.where(chosen.reshape(-1, *(1,) * (first.ndim - 1)), first, other)

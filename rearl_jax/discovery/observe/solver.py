"""Joint least squares: each driver's own parameters, the population's mean, and the added candidates.

Minimises for a state (one data set under one candidate)

    sum over drivers [(n + f) / 2 log S - f / 2 log S_usual + |(z - mean) / spread|^2 / 2]
        + |mean / location|^2 / 2 + |(theta - ref) / scale|^2 / 2,   S = (f S_usual + sum over steps of nu^2) / (f + n)

for many states in one batch. S is the variance of the innovations nu of a driver, and n the sum of their weights; the
prior of S is centred on S_usual and counts as f innovations. z are the driver's standardised parameters. The
population's spread is fixed, because a spread that shrank with every step would give false evidence.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.clocks import following
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, Prior
from rearl_jax.discovery.observe.fit_state import DriverSums, FitState, replace_gain
from rearl_jax.discovery.observe.kalman import Gain
from rearl_jax.discovery.observe.layout import layout_of
from rearl_jax.discovery.observe.levenberg_marquardt import LevenbergMarquardt
from rearl_jax.discovery.observe.normal_equations import Programs
from rearl_jax.discovery.read.measured import Measured

ADDED_AT_ONCE = 8
"""Indices of added candidates that a program for the screen has room for; it has a multiple of them."""

UNSTABLE = 1e30
"""Sum of squared innovations of a driver whose observer is unstable [m^2]; finite, so that others can be judged."""

SIDE_BY_SIDE = 512
"""Pieces per batch that suffice to use all cores."""


class Solver:
    """Solver that optimises the parameters of many states in one batch."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.layout = programs, programs.layout

    def free(self, state: FitState) -> Int[np.ndarray, " free"]:
        """Indices of theta that are searched in a state."""
        return np.array(() if state.holds_shared else self.programs.free(state.active), int)

    def solve(self, states: Sequence[FitState], *, iterations: int = 25, tolerance: float = 0.03) -> None:
        """Searches until the objective falls by less than `tolerance` [nats] or after some iterations.

        The states are changed in place; all must have the same active terms.
        """
        free = self.free(states[0])
        self.sums(states)
        searches = [LevenbergMarquardt(state, self.layout, free) for state in states]
        for _ in range(iterations):
            running = [search for search in searches if search.is_running]
            if not running:
                break
            points = [search.next_point() for search in running]
            self.sums(points)
            for search, trial in zip(running, points, strict=True):
                search.judge(trial, tolerance)

    def sensitivity_sums(self, states: Sequence[FitState]) -> list[dict[str, np.ndarray]]:
        """Sums of `sensitivity.sensitivity_sums` over each driver, along all directions of theta; all states must have
        the same added candidates.
        """
        free = self.free(states[0])
        # Repeated up to a few numbers of rows, so that one program serves all added candidates.
        added = np.resize(free if len(free) else [0], ADDED_AT_ONCE * max(1, math.ceil(len(free) / ADDED_AT_ONCE)))
        following_of = np.concatenate([following(state.data) for state in states], axis=-1)
        own = _own(states) | {"following": following_of, "added": added[:, None]}
        program = self.programs.sensitivities(own["z"].shape[1])
        found = _by_driver(program([state.pieces for state in states], own), states)
        n_nuisance = self.layout.prior.size + len(free)
        return [sums | {"nuisance": sums["nuisance"][:, :n_nuisance]} for sums in found]

    def innovations(
        self, states: Sequence[FitState], gain: Gain | None = None
    ) -> list[Float[np.ndarray, "steps pieces"]]:
        """Measured minus predicted positions [m] of each state; with another gain if given."""
        pieces = [state.pieces if gain is None else replace_gain(state.pieces, gain) for state in states]
        result = self.programs.innovations(states[0].active)(pieces, _own(states))
        return [result[..., columns] for columns in _columns(states)]

    def sums(self, states: Sequence[FitState]) -> None:
        """Computes the sums at the present parameters of each state, in place."""
        # Larger batches would only need more memory.
        together = max(1, SIDE_BY_SIDE // len(states[0].data.driver))
        program = self.programs.sums(states[0].active)
        for first in range(0, len(states), together):
            part = states[first : first + together]
            found = _by_driver(program([state.pieces for state in part], _own(part)), part)
            for state, sums in zip(part, found, strict=True):
                state.sums = stable(DriverSums(**sums))


def stable(sums: DriverSums) -> DriverSums:
    """The sums with those of drivers whose observer is unstable replaced. Their numbers overflow: they say that these
    parameters are impossible, but not in which direction better ones are.
    """
    is_stable = np.isfinite(sums.square) & np.isfinite(sums.gradient).all(axis=1)
    is_stable &= np.isfinite(sums.gram).all(axis=(1, 2))
    if is_stable.all():
        return sums
    return replace(
        sums,
        square=np.where(is_stable, sums.square, UNSTABLE),
        gradient=np.where(is_stable[:, None], sums.gradient, 0.0),
        gram=np.where(is_stable[:, None, None], sums.gram, 0.0),
    )


def solver_of(data: Measured, prior: Prior = IDM_PRIOR) -> Solver:
    """A solver with the layout and knots of the given data."""
    return Solver(Programs(layout_of(data, prior), data.dt, len(data.driver)))


def _own(states: Sequence[FitState]) -> dict[str, np.ndarray]:
    """Values of each piece that differ between evaluations, states side by side."""
    n_pieces = [len(state.data.driver) for state in states]
    return {
        "z": np.concatenate([state.z[state.data.driver].T for state in states], axis=1),
        "theta": np.repeat(np.stack([state.theta for state in states], axis=1), n_pieces, axis=1),
        "deviation": np.concatenate([np.sqrt(state.variances)[state.data.driver] for state in states]),
    }


def _by_driver(result: dict, states: Sequence[FitState]) -> list[dict[str, np.ndarray]]:
    """Sums over the pieces of each driver, for each state."""
    return [
        {name: _added(values[..., columns], state.data) for name, values in result.items()}
        for state, columns in zip(states, _columns(states), strict=True)
    ]


def _columns(states: Sequence[FitState]) -> list[slice]:
    """Columns of each state's pieces in the batch."""
    ends = np.cumsum([len(state.data.driver) for state in states])
    return [slice(end - len(state.data.driver), end) for state, end in zip(states, ends, strict=True)]


def _added(values: Float[np.ndarray, "*shape pieces"], data: Measured) -> Float[np.ndarray, "drivers *shape"]:
    """Values of pieces summed over each driver."""
    moved = np.moveaxis(np.asarray(values), -1, 0)
    total = np.zeros((data.n_drivers, *moved.shape[1:]))
    np.add.at(total, data.driver, moved)
    return total

"""Least squares over everything at once: each driver's own parameters, the population's mean, and what was added.

Minimises for a state (one data set under one candidate)

    sum over drivers [(n + f) / 2 log S - f / 2 log S_usual + |z - mean|^2 / 2]
        + |mean|^2 / 2 + |(theta - ref) / scale|^2 / 2,   S = (f S_usual + sum over steps of nu^2) / (f + n)

by Levenberg-Marquardt steps with one block per driver, eliminated by a Schur complement. The population's spread
stays at its prior: shrinking it towards the data makes false evidence. S is the variance of a driver's innovations, n
of which count; it scatters between drivers about S_usual as if each had shown f innovations before.

Source: Marquardt, SIAM J. Appl. Math. 11 (1963) 431; block elimination as in bundle adjustment, Triggs et al. (2000);
a variance of its own for everybody integrated out, Gelman et al., Bayesian Data Analysis (2013), chapter 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import jax
import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.candidates import Layout, Term
from rearl_jax.discovery.observe.clocks import following
from rearl_jax.discovery.observe.kalman import Gain, Noise
from rearl_jax.discovery.observe.normal_equations import Programs
from rearl_jax.discovery.observe.observer import Pieces, pieces_of, repeated, weights
from rearl_jax.discovery.read.measured import Measured

CLASSES = 2
"""Populations of drivers: cars and trucks."""

SIDE_BY_SIDE = 512
"""Pieces that fill all cores."""

VARIANCE_FREEDOM = 40.0
"""Innovations f that what is known of all drivers is worth for the variance of one driver's."""

VARIANCE_ITERATIONS = 5
"""Steps of the search for S_usual after each step of the search for everything else."""

LONGEST_STEP = 1.0
"""Bound of a step of a driver's standardised parameters [-]."""


@dataclass
class FitState:
    """One data set under one candidate: where the search is, and what was found.

    Attributes:
        data: What was measured.
        pieces: The same for the observer.
        z: Standardised parameters of the drivers.
        mean: Their mean over cars and trucks.
        theta: What was added.
        active: Terms that have been added; theirs are the places of theta that are searched.
        variance: Usual variance of the innovations, S_usual [m^2].
        freedom: Innovations f that it is worth; inf where all drivers have the usual variance.
        holds_population: Whether the mean stays as it is, and only the drivers are searched.
        holds_variance: Whether S_usual stays as it is.
        holds_theta: Whether what was added stays as it is.
        sums: At these parameters; None until they have been evaluated.
        log: The objective after each step of the search [nats].
    """

    data: Measured
    pieces: Pieces
    z: Float[np.ndarray, "drivers own"]
    mean: Float[np.ndarray, "classes own"]
    theta: Float[np.ndarray, " parameters"]
    active: tuple[Term, ...]
    variance: float
    freedom: float = VARIANCE_FREEDOM
    holds_population: bool = False
    holds_variance: bool = False
    holds_theta: bool = False
    sums: "DriverSums | None" = None
    log: list[float] = field(default_factory=list)

    @property
    def truck(self) -> Int[np.ndarray, " drivers"]:
        """Class of each driver: 0 car, 1 truck."""
        out = np.zeros(self.data.n_drivers, int)
        out[self.data.driver] = self.data.is_truck
        return out

    @property
    def variances(self) -> Float[np.ndarray, " drivers"]:
        """Variance S of each driver's innovations [m^2]; the usual one before they have been evaluated."""
        if self.sums is None or np.isinf(self.freedom):
            return np.full(self.data.n_drivers, self.variance)
        return (self.freedom * self.variance + self.sums.square) / (self.freedom + self.sums.count)

    def log_likelihood(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver's innovations, its variance integrated out, without the constant [nats]."""
        assert self.sums is not None
        n, square = self.sums.count, self.sums.square
        if np.isinf(self.freedom):
            return -0.5 * square / self.variance - 0.5 * np.log(self.variance) * n
        return 0.5 * self.freedom * np.log(self.variance) - 0.5 * (n + self.freedom) * np.log(self.variances)

    def penalised(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver and of its parameters in their population [nats]."""
        return self.log_likelihood() - 0.5 * ((self.z - self.mean[self.truck]) ** 2).sum(axis=1)


@dataclass(frozen=True)
class DriverSums:
    """Sums over the weighted time steps of each driver; its own directions first, then those of what was added.

    Attributes:
        square: Sum of squared innovations [m^2].
        gradient: Sum of innovation times derivative.
        gram: Sum of derivative times derivative.
        count: Sum of the weights.
    """

    square: Float[np.ndarray, " drivers"]
    gradient: Float[np.ndarray, "drivers directions"]
    gram: Float[np.ndarray, "drivers directions directions"]
    count: Float[np.ndarray, " drivers"]


def new_state(data: Measured, layout: Layout, noise: Noise) -> FitState:
    """A state at the usual parameters, with nothing added."""
    return FitState(
        data=data,
        pieces=pieces_of(data, noise),
        z=np.zeros((data.n_drivers, layout.prior.size)),
        mean=np.zeros((CLASSES, layout.prior.size)),
        theta=layout.reference.copy(),
        active=(),
        variance=float(noise.gain(data.dt, data.stride).variance),
    )


def with_noise(state: FitState, noise: Noise) -> FitState:
    """The same state under another observer; S_usual starts at what that observer expects."""
    gain = noise.gain(state.data.dt, state.data.stride)
    pieces = replace(replace_gain(state.pieces, gain), weight=weights(state.data, noise))
    return copied(state, pieces=pieces, variance=float(gain.variance))


def copied(state: FitState, **changes: object) -> FitState:
    """A state of its own, not evaluated yet, that begins where another one is."""
    own = {"z": state.z.copy(), "mean": state.mean.copy(), "sums": None, "log": []}
    return replace(state, **(own | changes))


def replace_gain(pieces: Pieces, gain: Gain) -> Pieces:
    """Pieces under another observer."""
    n = pieces.length.shape[0]
    return replace(pieces, gain=repeated(gain, n), deviation=np.full(n, np.sqrt(gain.variance)))


class Solver:
    """Finds the best parameters of many states side by side."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.layout = programs, programs.layout

    def free(self, state: FitState) -> Int[np.ndarray, " free"]:
        """Places of theta that are searched in a state."""
        if state.holds_theta:
            return np.empty(0, int)
        return np.array(self.programs.free(state.active), int)

    def solve(self, states: Sequence[FitState], *, iterations: int = 25, tolerance: float = 0.03) -> None:
        """Searches until the objective falls by less than `tolerance` [nats] or after some iterations.

        The states, in which the same is active, are changed in place.
        """
        free = self.free(states[0])
        joined = _joined([state.pieces for state in states])
        self._evaluate(states, joined, [True] * len(states))
        for state in states:
            _adapt_variance(state)
        value = [_objective(state, self.layout, free) for state in states]
        damping, active = [1e-2] * len(states), [True] * len(states)
        for iteration in range(iterations):
            tried = [
                _stepped(state, damping[k], self.layout, free) if active[k] else state for k, state in enumerate(states)
            ]
            self._evaluate(tried, joined, active)
            for k, (state, trial) in enumerate(zip(states, tried, strict=True)):
                if not active[k]:
                    continue
                reached = _objective(trial, self.layout, free)
                if reached < value[k]:
                    gained = value[k] - reached
                    state.z, state.mean, state.theta, state.sums = trial.z, trial.mean, trial.theta, trial.sums
                    _adapt_variance(state)
                    value[k], damping[k] = _objective(state, self.layout, free), max(damping[k] * 0.2, 1e-7)
                    active[k] = gained > tolerance or iteration < 3
                else:
                    damping[k] *= 8
                    active[k] = damping[k] < 1e4
                state.log.append(value[k])
            if not any(active):
                break

    def sums(self, states: Sequence[FitState]) -> None:
        """Fills in the sums at the present parameters."""
        # A few side by side fill the cores; more would only be copies of the same data.
        together = max(1, SIDE_BY_SIDE // len(states[0].data.driver))
        for first in range(0, len(states), together):
            part = states[first : first + together]
            self._evaluate(part, _joined([state.pieces for state in part]), [True] * len(part))

    def look(
        self, states: Sequence[FitState], places: tuple[int, ...], groups: tuple[tuple[int, ...], ...]
    ) -> list[dict[str, np.ndarray]]:
        """Sums of `sensitivity.look_along` over each driver; all states have added the same."""
        n_kept = len(self.free(states[0]))
        arguments = self._arguments(states, _joined([state.pieces for state in states]))
        arguments["following"] = np.concatenate([following(state.data) for state in states], axis=-1)
        return _by_driver(self.programs.look(places, groups, n_kept)(arguments), states)

    def innovations(self, states: Sequence[FitState], gain: Gain | None = None) -> list[np.ndarray]:
        """Measured minus predicted positions [m] of each state, `[n_steps, n_pieces]`; under another gain if given."""
        pieces = [state.pieces if gain is None else replace_gain(state.pieces, gain) for state in states]
        result = self.programs.innovations(states[0].active)(self._arguments(states, _joined(pieces)))
        return [result[..., columns] for columns in _columns(states)]

    def _evaluate(self, states: Sequence[FitState], joined: Pieces, active: Sequence[bool]) -> None:
        result = self.programs.sums(states[0].active)(self._arguments(states, joined))
        for state, sums, is_active in zip(states, _by_driver(result, states), active, strict=True):
            if is_active:
                state.sums = DriverSums(**sums)

    def _arguments(self, states: Sequence[FitState], joined: Pieces) -> dict:
        z = np.concatenate([state.z[state.data.driver].T for state in states], axis=1)
        n_pieces = [len(state.data.driver) for state in states]
        theta = np.repeat(np.stack([state.theta for state in states], axis=1), n_pieces, axis=1)
        deviation = np.concatenate([np.sqrt(state.variances)[state.data.driver] for state in states])
        return {"z": z, "theta": theta, "pieces": replace(joined, deviation=deviation)}


def _joined(parts: Sequence[Pieces]) -> Pieces:
    """Pieces of several states side by side."""
    if len(parts) == 1:
        return parts[0]
    known = max(part.known.shape[0] for part in parts)
    parts = [replace(part, known=np.broadcast_to(part.known, (known, part.known.shape[1]))) for part in parts]
    return jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)


def _by_driver(result: dict, states: Sequence[FitState]) -> list[dict[str, np.ndarray]]:
    """Sums over the pieces of each driver, for each state."""
    return [
        {name: _added(values[..., columns], state.data) for name, values in result.items()}
        for state, columns in zip(states, _columns(states), strict=True)
    ]


def _columns(states: Sequence[FitState]) -> list[slice]:
    """Where the pieces of each state are among those of all."""
    ends = np.cumsum([len(state.data.driver) for state in states])
    return [slice(end - len(state.data.driver), end) for state, end in zip(states, ends, strict=True)]


def _added(values: np.ndarray, data: Measured) -> np.ndarray:
    """Values of pieces, pieces last, added up over each driver, drivers first."""
    moved = np.moveaxis(np.asarray(values), -1, 0)
    total = np.zeros((data.n_drivers, *moved.shape[1:]))
    np.add.at(total, data.driver, moved)
    return total


def _adapt_variance(state: FitState) -> None:
    """Moves S_usual towards where it is most likely, the harmonic mean of the drivers' variances."""
    if not state.holds_variance:
        for _ in range(VARIANCE_ITERATIONS):
            state.variance = float(1 / np.mean(1 / state.variances))


def _objective(state: FitState, layout: Layout, free: np.ndarray) -> float:
    """Objective [nats], at the present S_usual."""
    off = (state.theta - layout.reference)[free] / layout.scale[free]
    return float(-state.penalised().sum() + 0.5 * (state.mean**2).sum() + 0.5 * (off**2).sum())


def _stepped(state: FitState, damping: float, layout: Layout, free: np.ndarray) -> FitState:
    """The state after one damped step."""
    assert state.sums is not None
    n_own, size = layout.prior.size, layout.prior.size + len(free)
    own, added = slice(0, n_own), slice(n_own, size)
    unit, scale = layout.unit[free], layout.scale[free]
    steps = np.concatenate([np.ones(n_own), unit])
    gram = state.sums.gram[:, :size, :size] * (steps[:, None] * steps) / state.variances[:, None, None]
    gradient = state.sums.gradient[:, :size] * steps / state.variances[:, None]
    away = state.z - state.mean[state.truck]
    n_mean = 0 if state.holds_population else CLASSES * n_own
    n, size = len(state.z), n_mean + len(free)
    own_block = gram[:, own, own] + np.eye(n_own)
    own_gradient = gradient[:, own] + away
    coupling = np.zeros((n, n_own, size))
    block, slope = np.zeros((size, size)), np.zeros(size)
    for c in range(CLASSES if n_mean else 0):
        place = slice(c * n_own, (c + 1) * n_own)
        members = state.truck == c
        coupling[members, :, place] = -np.eye(n_own)
        block[place, place] = (members.sum() + 1) * np.eye(n_own)
        slope[place] = state.mean[c] - away[members].sum(axis=0)
    last = slice(n_mean, size)
    coupling[:, :, last] = gram[:, own, added]
    block[last, last] = gram[:, added, added].sum(axis=0) + np.diag((unit / scale) ** 2)
    off = (state.theta - layout.reference)[free]
    slope[last] = gradient[:, added].sum(axis=0) + off * unit / scale**2
    damped = own_block + damping * np.einsum("dii,ij->dij", own_block, np.eye(n_own))
    solved = np.linalg.solve(damped, np.concatenate([own_gradient[:, :, None], coupling], axis=2))
    step = np.zeros(size)
    if size:
        reduced = block + damping * np.diag(np.diag(block)) - np.einsum("dij,dik->jk", coupling, solved[:, :, 1:])
        rest = slope - np.einsum("dij,di->j", coupling, solved[:, :, 0])
        step = -np.linalg.solve(reduced + 1e-9 * np.eye(size), rest)
    z_step = -(solved[:, :, 0] + solved[:, :, 1:] @ step)
    low, high = layout.prior.bounds
    theta = state.theta.copy()
    theta[free] += unit * np.clip(step[last], -LONGEST_STEP, LONGEST_STEP)
    z = np.clip(state.z + np.clip(z_step, -LONGEST_STEP, LONGEST_STEP), low[state.truck], high[state.truck])
    mean = state.mean
    if n_mean:
        mean = mean + np.clip(step[:n_mean], -LONGEST_STEP, LONGEST_STEP).reshape(-1, n_own)
    return replace(state, z=z, mean=mean, theta=np.clip(theta, layout.low, layout.high), sums=None)

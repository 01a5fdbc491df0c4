"""Least squares over everything at once: each driver's own parameters, the population's mean, and what was added.

Minimises for a world (one data set under one candidate)

    sum over moments of nu^2 / (2 S) + sum over drivers |z - mean|^2 / 2 + |mean|^2 / 2 + |(theta - ref) / scale|^2 / 2

by Levenberg-Marquardt steps with one block per driver, eliminated by a Schur complement. The population's spread
stays at its prior: shrinking it towards the data makes false evidence. S is the mean squared innovation.

Source: Marquardt, SIAM J. Appl. Math. 11 (1963) 431; block elimination as in bundle adjustment, Triggs et al. (2000).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import jax
import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.candidates import Layout, Term
from rearl_jax.discovery.observe.clocks import following
from rearl_jax.discovery.observe.kalman import Gain
from rearl_jax.discovery.observe.moments import Programs
from rearl_jax.discovery.observe.observer import Pieces, pieces_of, repeated
from rearl_jax.discovery.read.measured import Measured

CLASSES = 2
"""Populations of drivers: cars and trucks."""

SIDE_BY_SIDE = 512
"""Pieces that fill all cores."""

LONGEST_STEP = 1.0
"""Bound of a step of a driver's standardised parameters [-]."""


@dataclass
class World:
    """One data set under one candidate: where the search is, and what was found.

    Attributes:
        data: What was measured.
        pieces: The same for the observer.
        z: Standardised parameters of the drivers.
        mean: Their mean over cars and trucks.
        theta: What was added.
        active: Terms that have been added; theirs are the places of theta that are searched.
        variance: Mean squared innovation S [m^2].
        holds_population: Whether the mean stays as it is, and only the drivers are searched.
        holds_variance: Whether S stays as it is.
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

    def log_likelihood(self) -> Float[np.ndarray, " drivers"]:
        """Of each driver's innovations at S, without the constant [nats]."""
        assert self.sums is not None
        return -0.5 * self.sums.square / self.variance - 0.5 * np.log(self.variance) * self.sums.count

    def penalised(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver and of its parameters in their population [nats]."""
        return self.log_likelihood() - 0.5 * ((self.z - self.mean[self.truck]) ** 2).sum(axis=1)


@dataclass(frozen=True)
class DriverSums:
    """Sums over the weighted moments of each driver; its own directions first, then those of what was added.

    Attributes:
        square: Of squared innovations [m^2].
        gradient: Of innovation times derivative.
        gram: Of derivative times derivative.
        count: Of weights.
    """

    square: Float[np.ndarray, " drivers"]
    gradient: Float[np.ndarray, "drivers directions"]
    gram: Float[np.ndarray, "drivers directions directions"]
    count: Float[np.ndarray, " drivers"]


def new_world(data: Measured, layout: Layout, gain: Gain) -> World:
    """A world at the usual parameters, with nothing added."""
    return World(
        data=data,
        pieces=pieces_of(data, gain),
        z=np.zeros((data.n_drivers, layout.prior.size)),
        mean=np.zeros((CLASSES, layout.prior.size)),
        theta=layout.reference.copy(),
        active=(),
        variance=gain.variance,
    )


def with_gain(world: World, gain: Gain) -> World:
    """The same world under another observer; S starts at what that observer expects."""
    pieces = replace_gain(world.pieces, gain)
    return copied(world, pieces=pieces, variance=gain.variance)


def copied(world: World, **changes: object) -> World:
    """A world of its own, not evaluated yet, that begins where another one is."""
    own = {"z": world.z.copy(), "mean": world.mean.copy(), "sums": None, "log": []}
    return replace(world, **(own | changes))


def replace_gain(pieces: Pieces, gain: Gain) -> Pieces:
    """Pieces under another observer."""
    n = pieces.length.shape[0]
    return replace(pieces, gain=repeated(gain, n), deviation=np.full(n, np.sqrt(gain.variance)))


class Solver:
    """Finds the best parameters of many worlds side by side."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.layout = programs, programs.layout

    def free(self, world: World) -> Int[np.ndarray, " free"]:
        """Places of theta that are searched in a world."""
        if world.holds_theta:
            return np.empty(0, int)
        return np.array(self.programs.free(world.active), int)

    def solve(
        self,
        worlds: Sequence[World],
        *,
        iterations: int = 25,
        tolerance: float = 0.03,
    ) -> None:
        """Searches until the objective falls by less than `tolerance` [nats] or after some iterations.

        The worlds, in which the same is active, are changed in place.
        """
        free = self.free(worlds[0])
        joined = _joined([world.pieces for world in worlds])
        self._evaluate(worlds, joined, [True] * len(worlds))
        for world in worlds:
            _adapt_variance(world)
        value = [_objective(world, self.layout, free) for world in worlds]
        damping, active = [1e-2] * len(worlds), [True] * len(worlds)
        for iteration in range(iterations):
            tried = [
                _stepped(world, damping[k], self.layout, free) if active[k] else world for k, world in enumerate(worlds)
            ]
            self._evaluate(tried, joined, active)
            for k, (world, trial) in enumerate(zip(worlds, tried, strict=True)):
                if not active[k]:
                    continue
                reached = _objective(trial, self.layout, free)
                if reached < value[k]:
                    gained = value[k] - reached
                    world.z, world.mean, world.theta, world.sums = trial.z, trial.mean, trial.theta, trial.sums
                    _adapt_variance(world)
                    value[k], damping[k] = _objective(world, self.layout, free), max(damping[k] * 0.2, 1e-7)
                    active[k] = gained > tolerance or iteration < 3
                else:
                    damping[k] *= 8
                    active[k] = damping[k] < 1e4
                world.log.append(value[k])
            if not any(active):
                break

    def sums(self, worlds: Sequence[World]) -> None:
        """Fills in the sums at the present parameters."""
        # A few side by side fill the cores; more would only be copies of the same data.
        together = max(1, SIDE_BY_SIDE // len(worlds[0].data.driver))
        for first in range(0, len(worlds), together):
            part = worlds[first : first + together]
            self._evaluate(part, _joined([world.pieces for world in part]), [True] * len(part))

    def look(
        self, worlds: Sequence[World], places: tuple[int, ...], groups: tuple[tuple[int, ...], ...]
    ) -> list[dict[str, np.ndarray]]:
        """Sums of `sensitivity.look_along` over each driver; all worlds have added the same."""
        n_kept = len(self.free(worlds[0]))
        arguments = self._arguments(worlds, _joined([world.pieces for world in worlds]))
        arguments["following"] = np.concatenate([following(world.data) for world in worlds], axis=-1)
        result = self.programs.look(places, groups, n_kept)(arguments)
        return [
            {name: _added(values[..., columns], world.data) for name, values in result.items()}
            for world, columns in zip(worlds, _columns(worlds), strict=True)
        ]

    def innovations(self, worlds: Sequence[World], gain: Gain | None = None) -> list[np.ndarray]:
        """Measured minus predicted positions [m] of each world, `[n_steps, n_pieces]`; under another gain if given."""
        pieces = [world.pieces if gain is None else replace_gain(world.pieces, gain) for world in worlds]
        result = self.programs.innovations(worlds[0].active)(self._arguments(worlds, _joined(pieces)))
        return [result[..., columns] for columns in _columns(worlds)]

    def _evaluate(self, worlds: Sequence[World], joined: Pieces, active: Sequence[bool]) -> None:
        result = self.programs.sums(worlds[0].active)(self._arguments(worlds, joined))
        for world, found, is_active in zip(worlds, _by_driver(result, worlds), active, strict=True):
            if is_active:
                world.sums = found

    def _arguments(self, worlds: Sequence[World], joined: Pieces) -> dict:
        z = np.concatenate([world.z[world.data.driver].T for world in worlds], axis=1)
        theta = np.concatenate(
            [np.repeat(world.theta[:, None], len(world.data.driver), axis=1) for world in worlds], axis=1
        )
        deviation = np.concatenate([np.full(len(world.data.driver), np.sqrt(world.variance)) for world in worlds])
        return {"z": z, "theta": theta, "pieces": replace(joined, deviation=deviation)}


def _joined(parts: Sequence[Pieces]) -> Pieces:
    """Pieces of several worlds side by side."""
    if len(parts) == 1:
        return parts[0]
    known = max(part.known.shape[0] for part in parts)
    parts = [replace(part, known=np.broadcast_to(part.known, (known, part.known.shape[1]))) for part in parts]
    return jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)


def _by_driver(result: dict, worlds: Sequence[World]) -> list[DriverSums]:
    """Sums over the pieces of each driver, for each world."""
    return [
        DriverSums(**{name: _added(values[..., columns], world.data) for name, values in result.items()})
        for world, columns in zip(worlds, _columns(worlds), strict=True)
    ]


def _columns(worlds: Sequence[World]) -> list[slice]:
    """Where the pieces of each world are among those of all."""
    ends = np.cumsum([len(world.data.driver) for world in worlds])
    return [slice(end - len(world.data.driver), end) for world, end in zip(worlds, ends, strict=True)]


def _added(values: np.ndarray, data: Measured) -> np.ndarray:
    """Values of pieces, pieces last, added up over each driver, drivers first."""
    moved = np.moveaxis(np.asarray(values), -1, 0)
    total = np.zeros((data.n_drivers, *moved.shape[1:]))
    np.add.at(total, data.driver, moved)
    return total


def _adapt_variance(world: World) -> None:
    assert world.sums is not None
    if not world.holds_variance:
        world.variance = float(world.sums.square.sum() / max(world.sums.count.sum(), 1.0))


def _objective(world: World, layout: Layout, free: np.ndarray) -> float:
    """What is minimised [nats], at the present S."""
    assert world.sums is not None
    n = world.sums.count.sum()
    square = world.sums.square.sum()
    misfit = square / (2 * world.variance) if world.holds_variance else 0.5 * n * np.log(square / n)
    off = (world.theta - layout.reference)[free] / layout.scale[free]
    population = 0.5 * ((world.z - world.mean[world.truck]) ** 2).sum() + 0.5 * (world.mean**2).sum()
    return float(misfit + population + 0.5 * (off**2).sum())


def _stepped(world: World, damping: float, layout: Layout, free: np.ndarray) -> World:
    """The world after one damped step."""
    assert world.sums is not None
    n_own, q = layout.prior.size, len(free)
    own = slice(0, n_own)
    added = slice(n_own, n_own + q)
    size = n_own + q
    unit, scale = layout.unit[free], layout.scale[free]
    steps = np.concatenate([np.ones(n_own), unit])
    gram = world.sums.gram[:, :size, :size] * (steps[:, None] * steps) / world.variance
    gradient = world.sums.gradient[:, :size] * steps / world.variance
    away = world.z - world.mean[world.truck]
    n_mean = 0 if world.holds_population else CLASSES * n_own
    n, size = len(world.z), n_mean + q
    own_block = gram[:, own, own] + np.eye(n_own)
    own_gradient = gradient[:, own] + away
    coupling = np.zeros((n, n_own, size))
    block, slope = np.zeros((size, size)), np.zeros(size)
    if n_mean:
        for c in range(CLASSES):
            place = slice(c * n_own, (c + 1) * n_own)
            members = world.truck == c
            coupling[members, :, place] = -np.eye(n_own)
            block[place, place] = (members.sum() + 1) * np.eye(n_own)
            slope[place] = world.mean[c] - away[members].sum(axis=0)
    last = slice(n_mean, size)
    coupling[:, :, last] = gram[:, own, added]
    block[last, last] = gram[:, added, added].sum(axis=0) + np.diag((unit / scale) ** 2)
    off = (world.theta - layout.reference)[free]
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
    theta = world.theta.copy()
    theta[free] += unit * np.clip(step[last], -LONGEST_STEP, LONGEST_STEP)
    return replace(
        world,
        z=np.clip(world.z + np.clip(z_step, -LONGEST_STEP, LONGEST_STEP), low[world.truck], high[world.truck]),
        mean=world.mean + np.clip(step[:n_mean], -LONGEST_STEP, LONGEST_STEP).reshape(-1, n_own)
        if n_mean
        else world.mean,
        theta=np.clip(theta, layout.low, layout.high),
        sums=None,
    )

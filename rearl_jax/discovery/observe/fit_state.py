"""One data set under one candidate: where the search for its parameters is, and how well they do there.

Source of a variance of its own for everybody, integrated out: Gelman et al., Bayesian Data Analysis (2013), chapter 3.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.candidates import Layout, Term
from rearl_jax.discovery.observe.kalman import Gain, Noise
from rearl_jax.discovery.observe.observer import Pieces, pieces_of, repeated, weights
from rearl_jax.discovery.read.measured import Measured

CLASSES = 2
"""Populations of drivers: cars and trucks."""

VARIANCE_FREEDOM = 40.0
"""Innovations f that what is known of all drivers is worth for the variance of one driver's."""


@dataclass
class FitState:
    """One data set under one candidate: where the search is, and what was found.

    Attributes:
        data: What was measured.
        pieces: The same for the observer.
        z: Standardised parameters of the drivers.
        mean: Their mean over cars and trucks.
        spread: Their standard deviation between drivers; 1 before anything is known of it.
        theta: What was added.
        active: Terms that have been added; theirs are the places of theta that are searched.
        variance: Usual variance of the innovations, S_usual [m^2].
        freedom: Innovations f that it is worth; inf where all drivers have the usual variance.
        holds_population: Whether the mean stays as it is, and only the drivers are searched; the spread always does.
        holds_variance: Whether S_usual stays as it is.
        holds_theta: Whether what was added stays as it is.
        sums: At these parameters; None until they have been evaluated.
        objective: What the search makes small, at these parameters [nats]; inf before it has begun.
    """

    data: Measured
    pieces: Pieces
    z: Float[np.ndarray, "drivers own"]
    mean: Float[np.ndarray, "classes own"]
    spread: Float[np.ndarray, " own"]
    theta: Float[np.ndarray, " parameters"]
    active: tuple[Term, ...]
    variance: float
    freedom: float = VARIANCE_FREEDOM
    holds_population: bool = False
    holds_variance: bool = False
    holds_theta: bool = False
    sums: "DriverSums | None" = None
    objective: float = np.inf

    @property
    def truck(self) -> Int[np.ndarray, " drivers"]:
        """Class of each driver: 0 car, 1 truck."""
        out = np.zeros(self.data.n_drivers, int)
        out[self.data.driver] = self.data.is_truck
        return out

    @property
    def away(self) -> Float[np.ndarray, "drivers own"]:
        """Standardised parameters less their mean."""
        return self.z - self.mean[self.truck]

    @property
    def precision(self) -> Float[np.ndarray, "own own"]:
        """Inverse covariance of standardised parameters between drivers."""
        return np.diag(self.spread**-2.0)

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
        return self.log_likelihood() - 0.5 * (self.away**2 / self.spread**2).sum(axis=1)

    def log_width(self) -> Float[np.ndarray, " drivers"]:
        """Twice the logarithm of how much narrower than its population each driver's own parameters are known [-]."""
        assert self.sums is not None
        n_own = self.z.shape[1]
        own = self.sums.gram[:, :n_own, :n_own] / self.variances[:, None, None] + self.precision
        return np.linalg.slogdet(own)[1] + 2 * np.log(self.spread).sum()

    def marginal(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver with its own parameters integrated out over their population [nats]: models of
        different numbers of parameters compare, for each parameter costs what the data narrow it by.

        Source: Laplace approximation of the evidence, MacKay, Neural Comput. 4 (1992) 415.
        """
        return self.penalised() - 0.5 * self.log_width()


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
        spread=np.ones(layout.prior.size),
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
    own = {"z": state.z.copy(), "mean": state.mean.copy(), "sums": None, "objective": np.inf}
    return replace(state, **(own | changes))


def replace_gain(pieces: Pieces, gain: Gain) -> Pieces:
    """Pieces under another observer."""
    n = pieces.length.shape[0]
    return replace(pieces, gain=repeated(gain, n), deviation=np.full(n, np.sqrt(gain.variance)))

"""State of the fit of one data set under one candidate (effect that may be missing): parameters, sums and objective.

Innovations are the prediction errors of the observer. z are the drivers' standardised parameters, theta the parameters
of all candidates.

Source for the variance of each driver, integrated out: Gelman et al., Bayesian Data Analysis (2013), chapter 3.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.candidates import Layout, Term
from rearl_jax.discovery.observe.kalman import Gain, Noise
from rearl_jax.discovery.observe.observer import Pieces, pieces_of, repeated, weights
from rearl_jax.discovery.read.measured import Measured

CLASSES = 2
"""Number of populations of drivers: cars and trucks."""

VARIANCE_FREEDOM = 40.0
"""Number f of innovations that the prior of one driver's variance counts as; the prior is centred on S_usual, the
variance common to the drivers.
"""

ROUNDING = float(np.finfo(np.float32).eps)
"""Relative rounding error of sums over time, which are computed in single precision [-]."""


@dataclass
class FitState:
    """State of the fit of one data set under one candidate.

    Attributes:
        data: Measured drives.
        pieces: The measured drives as arrays for the observer.
        z: Standardised parameters of the drivers.
        mean: Mean standardised parameters of cars and of trucks.
        spread: Standard deviation of standardised parameters between drivers; 1 before it is estimated.
        theta: Parameters of the added candidates.
        active: Terms that have been added; the search varies their elements of theta.
        variance: Common variance of the innovations, S_usual [m^2].
        freedom: Prior weight f of S_usual, as a number of innovations; inf if all drivers have the variance S_usual.
        holds_shared: Whether mean, theta and S_usual are fixed and only drivers' parameters are searched; the spread is
            always fixed.
        sums: Sums at these parameters; None until they have been evaluated.
        objective: Objective that the search minimises, at these parameters [nats]; inf before the search begins.
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
    holds_shared: bool = False
    sums: "DriverSums | None" = None
    objective: float = np.inf

    @property
    def truck(self) -> Int[np.ndarray, " drivers"]:
        """Class of each driver: 0 car, 1 truck."""
        return self.data.driver_values(self.data.is_truck).astype(int)

    @property
    def away(self) -> Float[np.ndarray, "drivers own"]:
        """Standardised parameters less the mean of the driver's class [-]."""
        return self.z - self.mean[self.truck]

    @property
    def precision(self) -> Float[np.ndarray, "own own"]:
        """Inverse covariance of standardised parameters between drivers."""
        return np.diag(self.spread**-2.0)

    @property
    def variances(self) -> Float[np.ndarray, " drivers"]:
        """Variance S of each driver's innovations [m^2]; S_usual before they have been evaluated."""
        if self.sums is None or np.isinf(self.freedom):
            return np.full(self.data.n_drivers, self.variance)
        return (self.freedom * self.variance + self.sums.square) / (self.freedom + self.sums.count)

    @property
    def own_information(self) -> Float[np.ndarray, "drivers own own"]:
        """Information on each driver's standardised parameters in its innovations, without that of the population."""
        assert self.sums is not None
        n_own = self.z.shape[1]
        return self.sums.gram[:, :n_own, :n_own] / self.variances[:, None, None]

    @property
    def own_variance(self) -> Float[np.ndarray, "drivers own"]:
        """Variance of the estimates of each driver's standardised parameters, all else fixed [-]."""
        return np.einsum("dii->di", np.linalg.inv(with_prior(self.own_information, self.precision)))

    def log_likelihood(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver's innovations with its variance integrated out, less a constant [nats]."""
        assert self.sums is not None
        n, square = self.sums.count, self.sums.square
        if np.isinf(self.freedom):
            return -0.5 * square / self.variance - 0.5 * np.log(self.variance) * n
        return 0.5 * self.freedom * np.log(self.variance) - 0.5 * (n + self.freedom) * np.log(self.variances)

    def penalised(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver plus the log prior density of its parameters in the population [nats]."""
        return self.log_likelihood() - 0.5 * (self.away**2 / self.spread**2).sum(axis=1)

    def log_width(self) -> Float[np.ndarray, " drivers"]:
        """Twice the logarithm of the ratio of prior to posterior width of each driver's own parameters [-]."""
        return np.linalg.slogdet(with_prior(self.own_information, self.precision))[1] + 2 * np.log(self.spread).sum()

    def marginal(self) -> Float[np.ndarray, " drivers"]:
        """Log-likelihood of each driver with its own parameters integrated out over the population [nats]. It makes
        models with different numbers of parameters comparable, because each parameter is penalised by how much the data
        narrow it.

        Source: Laplace approximation of the evidence, MacKay, Neural Comput. 4 (1992) 415.
        """
        return self.penalised() - 0.5 * self.log_width()


def with_prior(
    information: Float[np.ndarray, "drivers own own"], precision: Float[np.ndarray, "own own"]
) -> Float[np.ndarray, "drivers own own"]:
    """Information on each driver's parameters with that of the population; it can be inverted even if the observer of a
    driver is unstable.

    The derivatives of an unstable observer grow along one direction until rounding errors exceed the prior. These
    errors are therefore added to the diagonal.
    """
    rounding = ROUNDING * np.einsum("dii,ij->dij", information, np.eye(len(precision)))
    return information + rounding + precision


@dataclass(frozen=True)
class DriverSums:
    """Sums over the weighted time steps of each driver. Derivatives are by the driver's own parameters, then by those
    of the added candidates (`directions`).

    Attributes:
        square: Sum of squared innovations [m^2].
        gradient: Sum of innovation times derivative of the innovation.
        gram: Sum of derivative times derivative.
        count: Sum of the weights.
    """

    square: Float[np.ndarray, " drivers"]
    gradient: Float[np.ndarray, "drivers directions"]
    gram: Float[np.ndarray, "drivers directions directions"]
    count: Float[np.ndarray, " drivers"]


def new_state(data: Measured, layout: Layout, noise: Noise) -> FitState:
    """A state at the prior's median parameters, without candidates."""
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
    """A state under the observer for another noise; S_usual starts at the variance that this observer expects."""
    gain = noise.gain(state.data.dt, state.data.stride)
    pieces = replace(replace_gain(state.pieces, gain), weight=weights(state.data, noise))
    return replaced(state, pieces=pieces, variance=float(gain.variance))


def replaced(state: FitState, **changes: object) -> FitState:
    """A copy of a state with changes, not evaluated yet."""
    copied = {"z": state.z.copy(), "mean": state.mean.copy(), "sums": None, "objective": np.inf}
    return replace(state, **(copied | changes))


def replace_gain(pieces: Pieces, gain: Gain) -> Pieces:
    """Pieces with another gain of the observer."""
    n = pieces.length.shape[0]
    return replace(pieces, gain=repeated(gain, n), deviation=np.full(n, np.sqrt(gain.variance)))

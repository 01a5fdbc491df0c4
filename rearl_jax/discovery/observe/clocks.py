"""Clock offsets between vehicles: an artefact of data loggers, with one offset per vehicle.

If the leader's clock is ahead by d, the data show the leader where it was d earlier. In a platoon the offset of one
vehicle acts twice: on its follower, and with the opposite sign on its own response to its leader. Other faults, such as
a wrong length of the leader, shift each leader-follower pair independently. Score and information are the first and the
negative second derivative of the log-likelihood.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.observer import synchronised
from rearl_jax.discovery.read.measured import Measured

CLOCK_OFFSET = Term("clock_offset")
"""Clock offsets between vehicles."""

MOST_LEADERS = 4
"""Largest number of main leaders of one driver; shifts are estimated from the time behind them alone."""

VARIANCES = (0.01, 0.04, 0.1)
"""Tested variances of offsets [s^2]; the best one is used."""


def main_leaders(data: Measured) -> Int[np.ndarray, "drivers leaders"]:
    """The leaders that each driver followed longest; -1 if there were fewer."""
    longest = np.full((data.n_drivers, MOST_LEADERS), -1)
    for driver in range(data.n_drivers):
        pieces = data.driver == driver
        leaders = data.leader[:, pieces][data.weight[:, pieces] > 0]
        vehicles, counts = np.unique(leaders[leaders >= 0], return_counts=True)
        ordered = vehicles[np.argsort(-counts)][:MOST_LEADERS]
        longest[driver, : len(ordered)] = ordered
    return longest


def following(data: Measured) -> Float[np.ndarray, "leaders steps pieces"]:
    """1 in each time step in which a driver follows its k-th main leader, else 0."""
    leaders = main_leaders(data)[data.driver]  # [pieces, leaders]
    return (data.leader[None] == leaders.T[:, None]).astype(float) * (leaders.T[:, None] >= 0)


@dataclass(frozen=True)
class ShiftEstimate:
    """Estimated time shifts of leaders by group [s], the groups being those of the model of shifts (`Shifts`), and
    their complexity penalty: prior and Occam factor [nats].
    """

    values: Float[np.ndarray, "groups numbers"]
    cost: float


class Shifts(ABC):
    """A model of how leaders are shifted in time. Shifts that the same drivers' data determine form a group, which is
    estimated by itself.

    Attributes:
        relative_variance: Prior variance of a shift as a multiple of that of a clock offset [-].
        data: Data as measured.
        values: Shifts of zero, the start value.
    """

    relative_variance: float
    data: Measured
    values: Float[np.ndarray, "groups numbers"]

    @abstractmethod
    def normal_equations(
        self, score: Float[np.ndarray, "drivers leaders"], information: Float[np.ndarray, "drivers leaders leaders"]
    ) -> tuple[Float[np.ndarray, "groups numbers"], Float[np.ndarray, "groups numbers numbers"]]:
        """Right-hand side and matrix of the normal equations for the shifts: their score and information, from those of
        each driver with respect to the times by which the clocks of its main leaders are ahead of its own.
        """

    @abstractmethod
    def corrected(self, values: Float[np.ndarray, "groups numbers"]) -> Measured:
        """The data with the shifts of leaders removed."""

    def evidence(
        self, score: Float[np.ndarray, "drivers leaders"], information: Float[np.ndarray, "drivers leaders leaders"]
    ) -> float:
        """Evidence for shifts against no shifts, from the score at zero shift [nats]; arguments as of
        `normal_equations`.
        """
        score, information = self.normal_equations(score, information)
        return max(self._updated(self.values, score, information, variance)[1] for variance in VARIANCES)

    def estimate(
        self,
        values: Float[np.ndarray, "groups numbers"],
        score: Float[np.ndarray, "drivers leaders"],
        information: Float[np.ndarray, "drivers leaders leaders"],
    ) -> ShiftEstimate:
        """Improved shifts, from the score at the present shifts; other arguments as of `normal_equations`."""
        score, information = self.normal_equations(score, information)
        updates = [self._updated(values, score, information, variance) for variance in VARIANCES]
        estimate, _ = max(updates, key=lambda update: update[1])
        return estimate

    def _updated(
        self, values: np.ndarray, score: np.ndarray, information: np.ndarray, variance: float
    ) -> tuple[ShiftEstimate, float]:
        """Most likely shifts, and the evidence for them against the present shifts [nats]: their gain of
        log-likelihood, to second order, less their complexity penalty.
        """
        variance *= self.relative_variance
        inner = np.eye(values.shape[1]) + variance * information
        step = np.linalg.solve(inner, (variance * score - values)[:, :, None])[:, :, 0]
        updated = values + step
        cost = 0.5 * float((updated**2).sum()) / variance + 0.5 * float(np.linalg.slogdet(inner)[1].sum())
        gain = float((score * step).sum() - 0.5 * np.einsum("gi,gij,gj->", step, information, step))
        return ShiftEstimate(updated, cost), gain - cost


class Clocks(Shifts):
    """Clock offsets of the vehicles, in one group.

    Attributes:
        vehicle: Numbers of the vehicles.
    """

    relative_variance = 1.0

    def __init__(self, data: Measured) -> None:
        leaders = main_leaders(data)
        vehicle_of = data.driver_values(data.vehicle)
        self.data, self.vehicle = data, np.unique(np.concatenate([vehicle_of, leaders[leaders >= 0]]))
        self.values = np.zeros((1, len(self.vehicle)))
        # Derivative of the time by which each main leader's clock is ahead of the driver's, by each vehicle's offset.
        self._derivative = np.zeros((*leaders.shape, len(self.vehicle)))
        driver, k = np.nonzero(leaders >= 0)
        self._derivative[driver, k, np.searchsorted(self.vehicle, leaders[driver, k])] += 1.0
        self._derivative[driver, k, np.searchsorted(self.vehicle, vehicle_of[driver])] -= 1.0

    def normal_equations(self, score: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Score and information of the offsets, summed over all drivers."""
        matrix = np.zeros((len(self.vehicle), len(self.vehicle)))
        for derivative, of_driver in zip(self._derivative, information, strict=True):
            matrix += derivative.T @ of_driver @ derivative
        return np.einsum("dkn,dk->n", self._derivative, score)[None], matrix[None]

    def corrected(self, values: np.ndarray) -> Measured:
        """The data with corrected clocks, for all leaders whose offset was estimated: main leaders of any driver, and
        leaders that are drivers themselves.
        """

        def offset(vehicle: np.ndarray) -> np.ndarray:
            place = np.minimum(np.searchsorted(self.vehicle, vehicle), len(self.vehicle) - 1)
            return np.where(self.vehicle[place] == vehicle, values[0, place], 0.0)

        leader = self.data.leader
        return _moved(self.data, np.where(leader >= 0, offset(leader) - offset(self.data.vehicle)[None], 0.0))


class Pairs(Shifts):
    """One shift for every driver and main leader; each driver is a group."""

    relative_variance = 2.0

    def __init__(self, data: Measured) -> None:
        self.data, self.values = data, np.zeros((data.n_drivers, MOST_LEADERS))

    def normal_equations(self, score: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Score and information of each driver, unchanged."""
        return score, information

    def corrected(self, values: np.ndarray) -> Measured:
        """The data with the main leaders of each driver corrected; its other leaders stay as measured."""
        return _moved(self.data, np.einsum("ksp,pk->sp", following(self.data), values[self.data.driver]))


def _moved(data: Measured, shift: Float[np.ndarray, "steps pieces"]) -> Measured:
    """The data with corrected leaders; `shift` is the time by which the leader's clock is ahead [s], so the leader
    is moved to where it was that much later.
    """
    surroundings = synchronised(data.surroundings, jnp.asarray(shift))
    moved = {name: np.asarray(getattr(surroundings, name)) for name in ("leader_rear", "leader_speed")}
    return replace(data, surroundings=replace(data.surroundings, **moved))

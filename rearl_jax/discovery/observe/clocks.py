"""Clock offsets between vehicles: an artefact of data loggers, with one offset per vehicle.

If the leader's clock is ahead by d, the data show the leader where it will be after d. In a platoon the offset of one
vehicle acts twice: on its follower, and with the opposite sign on its own response to its leader. Other faults, such as
a wrong length of the leader, shift each leader-follower pair independently.
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
"""Largest number of leaders of one driver with a shift of their own; further leaders are not shifted."""

VARIANCES = (0.01, 0.04, 0.1)
"""Tested variances of offsets [s^2]; the best one is used."""


def main_leaders(data: Measured) -> Int[np.ndarray, "drivers leaders"]:
    """The leaders that each driver followed longest; -1 if there were fewer."""
    leaders_of = np.full((data.n_drivers, MOST_LEADERS), -1)
    for driver in range(data.n_drivers):
        pieces = data.driver == driver
        leaders = data.leader[:, pieces][data.weight[:, pieces] > 0]
        names, counts = np.unique(leaders[leaders >= 0], return_counts=True)
        order = names[np.argsort(-counts)][:MOST_LEADERS]
        leaders_of[driver, : len(order)] = order
    return leaders_of


def following(data: Measured) -> Float[np.ndarray, "leaders steps pieces"]:
    """1 if a driver follows its k-th main leader."""
    leaders = main_leaders(data)[data.driver]  # [pieces, leaders]
    return (data.leader[None] == leaders.T[:, None]).astype(float) * (leaders.T[:, None] >= 0)


@dataclass(frozen=True)
class Estimate:
    """Time shifts of leaders.

    Attributes:
        values: Shifts [s].
        cost: Complexity penalty of the shifts: prior and Occam factor [nats].
    """

    values: Float[np.ndarray, "groups numbers"]
    cost: float


class Shifts(ABC):
    """A model of how leaders are shifted in time; shifts of different groups are independent.

    Attributes:
        values_per_shift: Prior variance of a shift as a multiple of that of a clock offset [-].
        data: As measured.
        values: Shifts of zero, the start value.
    """

    values_per_shift: float
    data: Measured
    values: Float[np.ndarray, "groups numbers"]

    @abstractmethod
    def normal(
        self, score: Float[np.ndarray, "drivers leaders"], information: Float[np.ndarray, "drivers leaders leaders"]
    ) -> tuple[Float[np.ndarray, "groups numbers"], Float[np.ndarray, "groups numbers numbers"]]:
        """Score and information of the shifts.

        Args:
            score: Score of each driver with respect to the time by which each main leader is ahead.
            information: Information matrix with respect to the same times.
        """

    @abstractmethod
    def corrected(self, values: Float[np.ndarray, "groups numbers"]) -> Measured:
        """The data with the shifts of leaders removed."""

    def evidence(
        self, score: Float[np.ndarray, "drivers leaders"], information: Float[np.ndarray, "drivers leaders leaders"]
    ) -> float:
        """Evidence for shifts against no shifts, from the score at zero shift [nats]; arguments as of `normal`."""
        side, total = self.normal(score, information)
        return max(self._fitted(self.values, side, total, variance)[1] for variance in VARIANCES)

    def estimate(
        self,
        values: Float[np.ndarray, "groups numbers"],
        score: Float[np.ndarray, "drivers leaders"],
        information: Float[np.ndarray, "drivers leaders leaders"],
    ) -> Estimate:
        """Improved shifts, from the score at the present shifts; other arguments as of `normal`."""
        side, total = self.normal(score, information)
        fits = [self._fitted(values, side, total, variance) for variance in VARIANCES]
        return max(fits, key=lambda fit: fit[1])[0]

    def _fitted(
        self, values: np.ndarray, side: np.ndarray, total: np.ndarray, variance: float
    ) -> tuple[Estimate, float]:
        """Most likely shifts and their log-likelihood, to second order."""
        variance *= self.values_per_shift
        inner = np.eye(values.shape[1]) + variance * total
        step = np.linalg.solve(inner, (variance * side - values)[:, :, None])[:, :, 0]
        better = values + step
        cost = 0.5 * float((better**2).sum()) / variance + 0.5 * float(np.linalg.slogdet(inner)[1].sum())
        gain = float((side * step).sum() - 0.5 * np.einsum("gi,gij,gj->", step, total, step))
        return Estimate(better, cost), gain - cost


class Clocks(Shifts):
    """Clock offsets of the vehicles, in one group.

    Attributes:
        vehicle: Numbers of the vehicles.
    """

    values_per_shift = 1.0

    def __init__(self, data: Measured) -> None:
        leaders = main_leaders(data)
        own = np.zeros(data.n_drivers, int)
        own[data.driver] = data.vehicle
        self.data, self.vehicle = data, np.unique(np.concatenate([own, leaders[leaders >= 0]]))
        self.values = np.zeros((1, len(self.vehicle)))
        # Time by which each main leader is ahead of each driver, per offset.
        self._ahead = np.zeros((*leaders.shape, len(self.vehicle)))
        driver, k = np.nonzero(leaders >= 0)
        self._ahead[driver, k, np.searchsorted(self.vehicle, leaders[driver, k])] += 1.0
        self._ahead[driver, k, np.searchsorted(self.vehicle, own[driver])] -= 1.0

    def normal(self, score: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Score and information summed over all drivers."""
        total = np.zeros((len(self.vehicle), len(self.vehicle)))
        for ahead, own in zip(self._ahead, information, strict=True):
            total += ahead.T @ own @ ahead
        return np.einsum("dkn,dk->n", self._ahead, score)[None], total[None]

    def corrected(self, values: np.ndarray) -> Measured:
        """The data with all leaders corrected, main leaders and others."""

        def offset(vehicle: np.ndarray) -> np.ndarray:
            where = np.minimum(np.searchsorted(self.vehicle, vehicle), len(self.vehicle) - 1)
            return np.where(self.vehicle[where] == vehicle, values[0, where], 0.0)

        leader = self.data.leader
        return _moved(self.data, np.where(leader >= 0, offset(leader) - offset(self.data.vehicle)[None], 0.0))


class Pairs(Shifts):
    """One shift for every driver and main leader; each driver is a group."""

    values_per_shift = 2.0

    def __init__(self, data: Measured) -> None:
        self.data, self.values = data, np.zeros((data.n_drivers, MOST_LEADERS))

    def normal(self, score: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Score and information of each driver, unchanged."""
        return score, information

    def corrected(self, values: np.ndarray) -> Measured:
        """The data with main leaders corrected."""
        return _moved(self.data, np.einsum("ksp,pk->sp", following(self.data), values[self.data.driver]))


def _moved(data: Measured, ahead: Float[np.ndarray, "steps pieces"]) -> Measured:
    """Leader positions moved back by the time they are ahead [s]."""
    around = synchronised(data.around, jnp.asarray(ahead))
    moved = {name: np.asarray(getattr(around, name)) for name in ("leader_rear", "leader_speed")}
    return replace(data, around=replace(data.around, **moved))

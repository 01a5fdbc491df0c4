"""Clocks that differ from vehicle to vehicle: an artefact of loggers, one number per vehicle.

A driver whose leader's clock is ahead by d sees the leader where it will be in d. Along a chain of vehicles the same
offset acts once as the leader's and once, with the other sign, as the follower's: that is its signature. What is no
clock, a leader that looks longer than it is, shifts every pair by itself.
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
"""Clocks that differ from vehicle to vehicle."""

MOST_LEADERS = 4
"""Leaders of one driver that are told apart; the others count as on time."""

VARIANCES = (0.01, 0.04, 0.1)
"""Variances of offsets [s^2] of which the best is taken."""


def usual_leaders(data: Measured) -> Int[np.ndarray, "drivers leaders"]:
    """The leaders each driver has followed longest, -1 where there were fewer."""
    usual = np.full((data.n_drivers, MOST_LEADERS), -1)
    for driver in range(data.n_drivers):
        pieces = data.driver == driver
        leaders = data.leader[:, pieces][data.weight[:, pieces] > 0]
        names, counts = np.unique(leaders[leaders >= 0], return_counts=True)
        order = names[np.argsort(-counts)][:MOST_LEADERS]
        usual[driver, : len(order)] = order
    return usual


def following(data: Measured) -> Float[np.ndarray, "leaders steps pieces"]:
    """1 where a driver follows its k-th usual leader."""
    leaders = usual_leaders(data)[data.driver]  # [pieces, leaders]
    return (data.leader[None] == leaders.T[:, None]).astype(float) * (leaders.T[:, None] >= 0)


@dataclass(frozen=True)
class Estimate:
    """Numbers that shift leaders in time.

    Attributes:
        values: [s].
        cost: What values of that size, and freedom to choose them, cost [nats].
    """

    values: Float[np.ndarray, "groups numbers"]
    cost: float


class Shifts(ABC):
    """An account of how leaders are shifted in time; numbers of one group have nothing to do with those of another.

    Attributes:
        values_per_shift: Variance of a number as a multiple of that of a clock [-].
        data: As measured.
        values: Nothing is shifted.
    """

    values_per_shift: float
    data: Measured
    values: Float[np.ndarray, "groups numbers"]

    @abstractmethod
    def normal(
        self, score: Float[np.ndarray, "drivers leaders"], information: Float[np.ndarray, "drivers leaders leaders"]
    ) -> tuple[Float[np.ndarray, "groups numbers"], Float[np.ndarray, "groups numbers numbers"]]:
        """Score and information of the numbers.

        Args:
            score: Scores of each driver, by how much each usual leader is ahead.
            information: The same.
        """

    @abstractmethod
    def corrected(self, values: Float[np.ndarray, "groups numbers"]) -> Measured:
        """The data as if leaders had not been shifted."""

    def evidence(
        self, score: Float[np.ndarray, "drivers leaders"], information: Float[np.ndarray, "drivers leaders leaders"]
    ) -> float:
        """For shifts, against none, from the score where nothing is shifted [nats]; arguments as of `normal`."""
        side, total = self.normal(score, information)
        return max(self._fitted(self.values, side, total, variance)[1] for variance in VARIANCES)

    def estimate(
        self,
        values: Float[np.ndarray, "groups numbers"],
        score: Float[np.ndarray, "drivers leaders"],
        information: Float[np.ndarray, "drivers leaders leaders"],
    ) -> Estimate:
        """Better numbers, from the score where some have shifted leaders already; other arguments as of `normal`."""
        side, total = self.normal(score, information)
        fits = [self._fitted(values, side, total, variance) for variance in VARIANCES]
        return max(fits, key=lambda fit: fit[1])[0]

    def _fitted(
        self, values: np.ndarray, side: np.ndarray, total: np.ndarray, variance: float
    ) -> tuple[Estimate, float]:
        """The most likely numbers, and how likely they are, to second order."""
        variance *= self.values_per_shift
        inner = np.eye(values.shape[1]) + variance * total
        step = np.linalg.solve(inner, (variance * side - values)[:, :, None])[:, :, 0]
        better = values + step
        cost = 0.5 * float((better**2).sum()) / variance + 0.5 * float(np.linalg.slogdet(inner)[1].sum())
        gain = float((side * step).sum() - 0.5 * np.einsum("gi,gij,gj->", step, total, step))
        return Estimate(better, cost), gain - cost


class Clocks(Shifts):
    """Offsets of the vehicles' clocks, one group.

    Attributes:
        vehicle: Which vehicles.
    """

    values_per_shift = 1.0

    def __init__(self, data: Measured) -> None:
        leaders = usual_leaders(data)
        own = np.zeros(data.n_drivers, int)
        own[data.driver] = data.vehicle
        self.data, self.vehicle = data, np.unique(np.concatenate([own, leaders[leaders >= 0]]))
        self.values = np.zeros((1, len(self.vehicle)))
        # By how much each usual leader is ahead of each driver, per offset.
        self._ahead = np.zeros((*leaders.shape, len(self.vehicle)))
        driver, k = np.nonzero(leaders >= 0)
        self._ahead[driver, k, np.searchsorted(self.vehicle, leaders[driver, k])] += 1.0
        self._ahead[driver, k, np.searchsorted(self.vehicle, own[driver])] -= 1.0

    def normal(self, score: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All drivers together."""
        total = np.zeros((len(self.vehicle), len(self.vehicle)))
        for ahead, own in zip(self._ahead, information, strict=True):
            total += ahead.T @ own @ ahead
        return np.einsum("dkn,dk->n", self._ahead, score)[None], total[None]

    def corrected(self, values: np.ndarray) -> Measured:
        """All leaders, usual or not."""

        def offset(vehicle: np.ndarray) -> np.ndarray:
            where = np.minimum(np.searchsorted(self.vehicle, vehicle), len(self.vehicle) - 1)
            return np.where(self.vehicle[where] == vehicle, values[0, where], 0.0)

        leader = self.data.leader
        return _moved(self.data, np.where(leader >= 0, offset(leader) - offset(self.data.vehicle)[None], 0.0))


class Pairs(Shifts):
    """A shift of every driver against every usual leader, a group per driver."""

    values_per_shift = 2.0

    def __init__(self, data: Measured) -> None:
        self.data, self.values = data, np.zeros((data.n_drivers, MOST_LEADERS))

    def normal(self, score: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As they are."""
        return score, information

    def corrected(self, values: np.ndarray) -> Measured:
        """Usual leaders."""
        return _moved(self.data, np.einsum("ksp,pk->sp", following(self.data), values[self.data.driver]))


def _moved(data: Measured, ahead: Float[np.ndarray, "steps pieces"]) -> Measured:
    """Leaders where they are at the own time, which are ahead by some time [s]."""
    around = synchronised(data.around, jnp.asarray(ahead))
    moved = {name: np.asarray(getattr(around, name)) for name in ("leader_rear", "leader_speed")}
    return replace(data, around=replace(data.around, **moved))

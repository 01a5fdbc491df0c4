"""Clocks that differ from vehicle to vehicle: an artefact of loggers, one number per vehicle.

A driver whose leader's clock is ahead by d sees the leader where it will be in d. Along a chain of vehicles the same
offset acts once as the leader's and once, with the other sign, as the follower's: that is its signature.
"""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.measured import Measured
from rearl_jax.discovery.observer import synchronised

NAME = "clock_offset"

MOST_LEADERS = 4
"""Leaders of one driver that are told apart; the others count as on time."""

VARIANCES = (0.01, 0.04, 0.1)
"""Variances of offsets [s^2] of which the best is taken."""


@dataclass(frozen=True)
class Clocks:
    """Offsets of the vehicles' clocks.

    Attributes:
        evidence: For offsets, against none [nats].
        pairs: For a shift of every driver against every leader of its own, against none [nats]; more than that for
            offsets where it is not clocks that differ.
        vehicle: Which vehicles.
        offset: By how much each one's clock is ahead [s].
    """

    evidence: float
    pairs: float
    vehicle: Int[np.ndarray, " vehicles"]
    offset: Float[np.ndarray, " vehicles"]


def usual_leaders(data: Measured) -> Int[np.ndarray, "drivers leaders"]:
    """The leaders each driver has followed longest, -1 where there were fewer."""
    found = np.full((data.n_drivers, MOST_LEADERS), -1)
    for driver in range(data.n_drivers):
        pieces = data.driver == driver
        leaders = data.leader[:, pieces][data.weight[:, pieces] > 0]
        names, counts = np.unique(leaders[leaders >= 0], return_counts=True)
        order = names[np.argsort(-counts)][:MOST_LEADERS]
        found[driver, : len(order)] = order
    return found


def following(data: Measured) -> Float[np.ndarray, "leaders steps pieces"]:
    """1 where a driver follows its k-th usual leader."""
    leaders = usual_leaders(data)[data.driver]  # [pieces, leaders]
    return (data.leader[None] == leaders.T[:, None]).astype(float) * (leaders.T[:, None] >= 0)


def clocks_of(
    data: Measured,
    score: Float[np.ndarray, "drivers leaders"],
    information: Float[np.ndarray, "drivers leaders leaders"],
) -> Clocks:
    """Offsets and their evidence.

    Args:
        data: The drivers.
        score: Of each driver, by how much each usual leader is ahead.
        information: The same.
    """
    leaders = usual_leaders(data)
    own = np.zeros(data.n_drivers, int)
    own[data.driver] = data.vehicle
    vehicles = np.unique(np.concatenate([own, leaders[leaders >= 0]]))
    place = {int(vehicle): k for k, vehicle in enumerate(vehicles)}
    n = len(vehicles)
    total, side = np.zeros((n, n)), np.zeros(n)
    for driver, names in enumerate(leaders):
        ahead = np.zeros((MOST_LEADERS, n))
        for k, name in enumerate(names):
            if name >= 0:
                ahead[k, place[int(name)]] += 1.0
                ahead[k, place[int(own[driver])]] -= 1.0
        total += ahead.T @ information[driver] @ ahead
        side += ahead.T @ score[driver]
    best = Clocks(-np.inf, _pairs(score, information), vehicles, np.zeros(n))
    for variance in VARIANCES:
        inner = np.eye(n) + variance * total
        offset = variance * np.linalg.solve(inner, side)
        evidence = float(0.5 * side @ offset - 0.5 * np.linalg.slogdet(inner)[1])
        if evidence > best.evidence:
            best = replace(best, evidence=evidence, offset=offset)
    return best


def _pairs(score: np.ndarray, information: np.ndarray) -> float:
    """Evidence for shifts that have nothing to do with each other [nats]."""
    found = []
    for variance in VARIANCES:
        inner = np.eye(score.shape[1]) + 2 * variance * information
        shift = 2 * variance * np.linalg.solve(inner, score[:, :, None])[:, :, 0]
        found.append(0.5 * float((score * shift).sum()) - 0.5 * float(np.linalg.slogdet(inner)[1].sum()))
    return max(found)


def corrected(data: Measured, clocks: Clocks) -> Measured:
    """The data as if all clocks had been right."""
    order = np.argsort(clocks.vehicle)
    names, offsets = clocks.vehicle[order], clocks.offset[order]

    def offset(vehicle: np.ndarray) -> np.ndarray:
        where = np.minimum(np.searchsorted(names, vehicle), len(names) - 1)
        return np.where(names[where] == vehicle, offsets[where], 0.0)

    ahead = np.where(data.leader >= 0, offset(data.leader) - offset(data.vehicle)[None], 0.0)
    around = synchronised(data.around, jnp.asarray(ahead))
    moved = {name: np.asarray(getattr(around, name)) for name in ("leader_rear", "leader_speed")}
    return replace(data, around=replace(data.around, **moved))

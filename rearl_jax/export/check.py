"""Exported drivers in SUMO compared with the same drivers in this package: gaps of platoons, and flow of many drivers.

Round trip: both programs simulate the same drivers behind the same measured first vehicles, so differences are those
of the programs. Flow: SUMO draws its drivers from the exported file; their speeds and headways are compared with those
of drivers that this package draws. A second draw of this package shows the effect of chance alone.
"""

from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.config.metrics import HistConfig
from rearl_jax.export.drawn import driver_columns, place_vehicles
from rearl_jax.export.platoon import ROAD, STEPS_PER_SECOND, Motion, Start, simulate, start_platoons
from rearl_jax.export.sumo import DISTRIBUTION, sumo_file, type_attributes
from rearl_jax.export.sumo_platoon import simulate_in_sumo
from rearl_jax.metrics.histograms import cumulative_counts, equal_edges, histogram_distances, speed_edges
from rearl_jax.models.population import Population

HEADWAY_EDGES = equal_edges(0.0, 5.0, 10)
"""Edges of the bins of time headways [s]; longer ones count in the last."""

MIN_SPEED = 1.0
"""Speed [m/s] below which no time headway is defined, as `thw.v_min`."""


def round_trip(
    population: Population,
    leader_speed: Float[np.ndarray, "steps platoons"],
    n_followers: int,
    seed: int,
    *,
    extended: bool = False,
) -> pd.DataFrame:
    """Differences of gaps between SUMO and this package: a row for car following alone, one with effects and noise.

    Columns: `compared`, `gap` (mean, here) and, of the absolute differences, `difference` (mean), `first` and `last`
    (mean of the first and of the last follower), `largest` [m]; `crashed` (share of
    followers whose gap falls below 0 in SUMO).

    Args:
        population: The drivers.
        leader_speed: Speeds of the first vehicles [m/s].
        n_followers: Followers of each.
        seed: Seed of drivers and of SUMO.
        extended: Whether to take SUMO's model with further terms.
    """
    following_alone = replace(population, effects=(), is_noisy=False)
    populations = {"car following": following_alone}
    if population.effects or population.is_noisy:
        populations["with effects and noise"] = population
    return pd.DataFrame(
        [
            _round_trip_row(label, drivers, leader_speed, n_followers, seed, extended)
            for label, drivers in populations.items()
        ]
    )


def _round_trip_row(
    label: str, population: Population, leader_speed: np.ndarray, n_followers: int, seed: int, extended: bool
) -> dict[str, Any]:
    """Row of `round_trip` for a population, named by a label."""
    start = start_platoons(population, leader_speed, n_followers, seed)
    types, names = {}, []
    for number in range(leader_speed.shape[1]):
        drivers = driver_columns(population, start.drivers, n_followers + 1, number)
        drawn = type_attributes(drivers, population.effects, extended=extended)
        names.append([f"driver_{number}_{k}" for k in range(1, n_followers + 1)])
        types |= dict(zip(names[-1], drawn[1:], strict=True))
    here = simulate(start, leader_speed)
    in_sumo = simulate_in_sumo(start, leader_speed, sumo_file(types), names, seed)
    difference = np.abs(in_sumo.gap - here.gap)
    return {
        "compared": label,
        "gap": float(here.gap.mean()),
        "difference": float(difference.mean()),
        "first": float(difference[:, 0].mean()),
        "last": float(difference[:, -1].mean()),
        "largest": float(difference.max()),
        "crashed": float((in_sumo.gap < 0).any(axis=0).mean()),
    }


def flow(
    population: Population,
    types: str,
    leader_speed: Float[np.ndarray, "steps platoons"],
    n_followers: int,
    seed: int,
) -> pd.DataFrame:
    """Speeds and time headways of drivers that SUMO draws from a file, and of two draws of this package.

    All start at the same positions, those of a third draw of drivers; every second after the start is measured.
    Columns: `traffic`, `speed`, `speed_sd` [m/s], `headway`, `headway_sd` [s], and the Hellinger distances of both
    distributions to the first draw of this package, `h_speed` and `h_headway` [-].
    """
    start = start_platoons(population, leader_speed, n_followers, seed)
    names = [[DISTRIBUTION] * n_followers] * leader_speed.shape[1]
    motions = {
        "here": _other_drivers(population, start, leader_speed, seed + 1),
        "here, other drivers": _other_drivers(population, start, leader_speed, seed + 2),
        "SUMO": simulate_in_sumo(start, leader_speed, types, names, seed),
    }
    measured = {name: _Measured.of(motion) for name, motion in motions.items()}
    reference = measured["here"]
    return pd.DataFrame([{"traffic": name, **traffic.compared_with(reference)} for name, traffic in measured.items()])


def _other_drivers(population: Population, start: Start, leader_speed: np.ndarray, seed: int) -> Motion:
    """The platoons from the same positions with other drivers."""
    _, drivers = place_vehicles(population, np.asarray(start.state.speed), ROAD, seed)
    return simulate(Start(start.state, drivers), leader_speed)


@dataclass(frozen=True)
class _Measured:
    """Followers at every second after the start.

    Attributes:
        speed: [m/s].
        headway: Time headways [s].
        has_headway: Mask of the values with a headway: the follower moves and is behind its leader.
    """

    speed: Float[np.ndarray, "seconds followers platoons"]
    headway: Float[np.ndarray, "seconds followers platoons"]
    has_headway: Bool[np.ndarray, "seconds followers platoons"]

    @classmethod
    def of(cls, motion: Motion) -> "_Measured":
        """Speeds and headways of some platoons."""
        seconds = slice(STEPS_PER_SECOND, None, STEPS_PER_SECOND)
        speed, gap = motion.speed[seconds, 1:], motion.gap[seconds]
        has_headway = (speed >= MIN_SPEED) & (gap > 0)
        return cls(speed, np.where(has_headway, gap, 0.0) / np.where(has_headway, speed, 1.0), has_headway)

    def compared_with(self, reference: "_Measured") -> dict[str, float]:
        """Means and standard deviations, and distances to the distributions of other traffic."""
        headway = self.headway[self.has_headway]
        return {
            "speed": float(self.speed.mean()),
            "speed_sd": float(self.speed.std()),
            "headway": float(headway.mean()),
            "headway_sd": float(headway.std()),
            "h_speed": _distance(*(counts(traffic.speed, speed_edges(HistConfig())) for traffic in (self, reference))),
            "h_headway": _distance(
                *(counts(traffic.headway, HEADWAY_EDGES, traffic.has_headway) for traffic in (self, reference))
            ),
        }


def counts(
    values: Float[np.ndarray, "seconds followers platoons"],
    edges: tuple[float, ...],
    valid: Bool[np.ndarray, "seconds followers platoons"] | None = None,
) -> Int[Array, " bins"]:
    """Number of (valid) values per bin, those outside in the outer bins."""
    mask = None if valid is None else jnp.asarray(valid)
    return cumulative_counts(jnp.asarray(values), edges, drop=False, valid=mask)[-1].sum(axis=-1, dtype=jnp.int32)


def _distance(histogram: Int[Array, " bins"], reference: Int[Array, " bins"]) -> float:
    """Hellinger distance of two distributions [-]."""
    return float(histogram_distances(histogram, reference, jnp.dtype(jnp.float64)).value)

"""Waves on a ring of equal vehicles: growth rates by the linear analysis and in the simulation.

Source: Sugiyama et al., New J. Phys. 10 (2008) 033001: 22 vehicles on a ring of 230 m.
"""

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.config.stability import StabilityConfig
from rearl_jax.study.stability.analysis import ring_growth
from rearl_jax.study.stability.cases import NEAR_DESIRED, Case
from rearl_jax.study.stability.roads import drive

PERTURBATION = 0.01
"""Standard deviation of the vehicles' displacements from equal spacing at the start [m], small enough for the linear
analysis.
"""

SETTLED = 120
"""Time after which the fastest wave dominates [s]."""

LARGEST_LINEAR = 0.1
"""Standard deviation of the speeds [m/s] up to which a wave grows exponentially, ten times PERTURBATION per second."""

SMALLEST = 1e-9
"""Standard deviation of the speeds [m/s] below which only rounding errors are left."""

RING_COLUMNS = ("length", "gap", "speed", "crests", "growth", "simulated_growth", "speed_sd", "slowest", "fastest")
RING_COLUMNS += ("analysis", "simulation", "agree")


def ring_table(case: Case, options: StabilityConfig) -> pd.DataFrame:
    """One row per ring on which the typical driver can drive at an equilibrium, with RING_COLUMNS.

    `growth` and `simulated_growth` [1/s] are those of the fastest wave and `crests` its number of crests by the
    analysis; `speed_sd`, `slowest` and `fastest` [m/s] are of the last 60 s; `analysis` and `simulation` are true where
    waves grow.
    """
    n, every = options.ring_vehicles, np.array(options.ring_lengths)
    gap = every / n - case.length
    speed = np.array([case.speed_at(own) for own in gap])
    drives = (speed > 0) & (speed < 0.999 * NEAR_DESIRED * case.desired_speed)
    if not drives.any():
        return pd.DataFrame(columns=list(RING_COLUMNS))
    length, gap, speed = every[drives], gap[drives], speed[drives]
    moved = np.random.default_rng(options.seed).normal(0.0, PERTURBATION, (n, 1))
    position = moved - np.arange(n)[:, None] * length / n
    seconds = options.ring_seconds
    motion = drive(
        case.typical, position, np.tile(speed, (n, 1)), seconds=seconds, seed=options.seed, circumference=length
    )
    deviation = motion.speed.std(axis=1)
    rows = []
    for k in range(len(length)):
        growth = ring_growth(case.slopes(speed[k]), case.scheme, n)
        late = motion.speed[-60:, :, k]
        analysis, simulation = bool(growth.max() > 0), waves_grow(deviation[:, k])
        found = (length[k], gap[k], speed[k], int(growth.argmax()) + 1, growth.max(), growth_rate(deviation[:, k]))
        last = (deviation[-60:, k].mean(), late.min(), late.max(), analysis, simulation, analysis == simulation)
        rows.append(dict(zip(RING_COLUMNS, (*found, *last), strict=True)))
    return pd.DataFrame(rows)


def waves_grow(deviation: Float[np.ndarray, " seconds"]) -> bool:
    """True if speeds differ more at the end than after SETTLED, or beyond what linear waves reach.

    Args:
        deviation: Standard deviation of the speeds over the vehicles [m/s].
    """
    end = deviation[-60:].mean()
    return bool(end > LARGEST_LINEAR or end > max(deviation[SETTLED : SETTLED + 60].mean(), SMALLEST))


def growth_rate(deviation: Float[np.ndarray, " seconds"]) -> float:
    """Slope of the logarithm of the deviation [1/s] between SETTLED and the end of the linear range; nan if that is
    shorter than 10 s.
    """
    is_linear = (deviation > SMALLEST) & (deviation < LARGEST_LINEAR)
    stop = len(deviation) if is_linear.all() else int(np.argmin(is_linear))
    time = np.arange(min(SETTLED, stop // 2), stop)
    return float(np.polyfit(time, np.log(deviation[time]), 1)[0]) if len(time) >= 10 else float("nan")

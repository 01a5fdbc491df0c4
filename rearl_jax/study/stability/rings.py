"""Waves on a ring of equal vehicles: growth rates by the linear analysis and in the simulation.

Source: Sugiyama et al., New J. Phys. 10 (2008) 033001: 22 vehicles on a ring of 230 m.
"""

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.config.stability import StabilityConfig
from rearl_jax.study.stability.analysis import ring_growth
from rearl_jax.study.stability.cases import MAX_SPEED_SHARE, Case
from rearl_jax.study.stability.roads import drive

START_SD = 0.01
"""Standard deviation of the vehicles' displacements from equal spacing at the start [m], small enough for the linear
analysis.
"""

SETTLING_TIME = 120
"""Time until the fastest wave dominates [s]."""

MAX_LINEAR_SD = 0.1
"""Standard deviation of the speeds [m/s] up to which a wave grows exponentially: ten times START_SD per second."""

ROUNDING_SD = 1e-9
"""Standard deviation of the speeds [m/s] below which only rounding errors are left."""

RING_COLUMNS = ("length", "gap", "speed", "crests", "growth", "simulated_growth", "speed_sd", "slowest", "fastest")
RING_COLUMNS += ("analysis", "simulation", "agree")


def ring_table(case: Case, options: StabilityConfig) -> pd.DataFrame:
    """One row per ring on which the typical driver can drive at an equilibrium, with RING_COLUMNS.

    `growth` and `simulated_growth` [1/s] are those of the fastest wave and `crests` its number of crests by the
    analysis; `speed_sd`, `slowest` and `fastest` [m/s] are of the last 60 s; `analysis` and `simulation` are true where
    waves grow.
    """
    n, lengths = options.ring_vehicles, np.array(options.ring_lengths)
    gap = lengths / n - case.length
    speed = np.array([case.speed_at(value) for value in gap])
    can_drive = (speed > 0) & (speed < 0.999 * MAX_SPEED_SHARE * case.desired_speed)
    if not can_drive.any():
        return pd.DataFrame(columns=list(RING_COLUMNS))
    length, gap, speed = lengths[can_drive], gap[can_drive], speed[can_drive]
    displacement = np.random.default_rng(options.seed).normal(0.0, START_SD, (n, 1))
    position = displacement - np.arange(n)[:, None] * length / n
    seconds = options.ring_seconds
    motion = drive(
        case.typical, position, np.tile(speed, (n, 1)), seconds=seconds, seed=options.seed, circumference=length
    )
    deviation = motion.speed.std(axis=1)
    rows = []
    for k in range(len(length)):
        growth = ring_growth(case.slopes(speed[k]), case.scheme, n)
        at_end = motion.speed[-60:, :, k]
        analysis, simulation = bool(growth.max() > 0), waves_grow(deviation[:, k])
        linear = (length[k], gap[k], speed[k], int(growth.argmax()) + 1, growth.max(), growth_rate(deviation[:, k]))
        last = (deviation[-60:, k].mean(), at_end.min(), at_end.max(), analysis, simulation, analysis == simulation)
        rows.append(dict(zip(RING_COLUMNS, (*linear, *last), strict=True)))
    return pd.DataFrame(rows)


def waves_grow(deviation: Float[np.ndarray, " seconds"]) -> bool:
    """True if the standard deviation of the speeds over the vehicles [m/s] is larger at the end than after
    SETTLING_TIME, or beyond what linear waves reach.
    """
    end = deviation[-60:].mean()
    return bool(end > MAX_LINEAR_SD or end > max(deviation[SETTLING_TIME : SETTLING_TIME + 60].mean(), ROUNDING_SD))


def growth_rate(deviation: Float[np.ndarray, " seconds"]) -> float:
    """Slope of the logarithm of the deviation [1/s] between SETTLING_TIME and the end of the linear range; nan if
    that range is shorter than 10 s.
    """
    is_linear = (deviation > ROUNDING_SD) & (deviation < MAX_LINEAR_SD)
    stop = len(deviation) if is_linear.all() else int(np.argmin(is_linear))
    time = np.arange(min(SETTLING_TIME, stop // 2), stop)
    return float(np.polyfit(time, np.log(deviation[time]), 1)[0]) if len(time) >= 10 else float("nan")

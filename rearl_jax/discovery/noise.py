"""How much of a drive is random: the observer whose predictions err least."""

from collections.abc import Sequence

import numpy as np

from rearl_jax.discovery.measured import Measured
from rearl_jax.discovery.observer import Noise
from rearl_jax.discovery.solver import Solver, World, new_world, with_gain

ACCELERATIONS = (0.03, 0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7, 1.0)
"""Standard deviations of what drivers do beside the model that are tried [m/s^2]."""

TIMES = (0.6, 1.5, 4.0)
"""Correlation times that are tried [s]. Source of the middle: Zhang & Sun, arXiv:2210.03571 (highD, about 1.4 s)."""

USUAL = Noise(0.15, 1.5, 0.1)


def best_noise(
    solver: Solver, worlds: Sequence[World], position: float, accelerations: Sequence[float] = ACCELERATIONS
) -> list[Noise]:
    """The noise under which each world, as it is, errs least in predicting the next position.

    Args:
        solver: Runs the observers.
        worlds: Calibrated already.
        position: Standard deviation of measured positions [m].
        accelerations: Those tried [m/s^2].
    """
    tried = [Noise(sd, time, position) for sd in accelerations for time in TIMES]
    trials = [[with_gain(world, noise.gain(world.data.dt)) for noise in tried] for world in worlds]
    solver.sums([trial for row in trials for trial in row])
    best = []
    for row in trials:
        errors = [trial.sums.square.sum() for trial in row if trial.sums is not None]
        best.append(tried[int(np.argmin(errors))])
    return best


def calibrate(solver: Solver, data: Measured) -> tuple[World, Noise]:
    """Drivers, their population and the noise, jointly, with nothing added to the model."""
    usual = Noise(USUAL.acceleration, USUAL.time, data.noise)
    world = new_world(data, solver.layout, usual.gain(data.dt))
    solver.solve([world], iterations=8, tolerance=1.0)
    (noise,) = best_noise(solver, [world], data.noise)
    world = with_gain(world, noise.gain(data.dt))
    solver.solve([world])
    return world, noise

"""A fitted model, and the same model on other drivers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.discovery.observe.candidates import Candidate
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.noise import ACCELERATIONS, best_noise, noises
from rearl_jax.discovery.observe.solver import Solver, World, new_world, with_gain
from rearl_jax.discovery.read.measured import Measured


@dataclass(frozen=True)
class Fit:
    """One candidate added to the model and fitted.

    Attributes:
        candidate: What was added last.
        world: With everything that was added.
        noise: Found anew under it.
    """

    candidate: Candidate | None
    world: World
    noise: Noise


def on_others(solver: Solver, data: Measured, fits: Sequence[Fit]) -> list[World]:
    """Other drivers under fitted models: each finds its own parameters, everything else stays.

    Every model has the same freedom, so likelihoods compare.
    """
    worlds = []
    for fit in fits:
        world = new_world(data, solver.layout, fit.noise.gain(data.dt, data.stride))
        world.mean, world.theta, world.active = fit.world.mean.copy(), fit.world.theta.copy(), fit.world.active
        world.z = world.mean[world.truck]
        world.variance = fit.world.variance
        world.holds_population = world.holds_variance = world.holds_theta = True
        solver.solve([world], iterations=15, tolerance=0.1)
        worlds.append(world)
    return worlds


def with_others(solver: Solver, fit: Fit, data: Measured) -> Fit:
    """The fitted drivers and others together, everything found anew from what was fitted.

    What few drivers show at times, such as what follows a cut-in, needs all of them to be seen.
    """
    world = fit.world
    both = new_world(world.data.beside(data), solver.layout, fit.noise.gain(data.dt, data.stride))
    both.mean, both.theta, both.active = world.mean.copy(), world.theta, world.active
    both.z = np.concatenate([world.z, both.mean[both.truck[world.data.n_drivers :]]])
    solver.solve([both], iterations=15, tolerance=0.3)
    noise, _ = best_noise(solver, both, noises(fit.noise, ACCELERATIONS))
    both = with_gain(both, noise.gain(data.dt, data.stride))
    solver.solve([both], iterations=15, tolerance=0.05)
    return replace(fit, world=both, noise=noise)

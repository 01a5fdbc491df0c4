"""Equilibrium time gaps of calibrated drivers, comparable between models with different parameters."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.config import DiscoverConfig
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver

SPEEDS = (10.0, 20.0)
"""Speeds at which equilibrium time gaps are stated [m/s]."""


def time_gaps(solver: Solver, state: FitState, speed: float) -> Float[np.ndarray, " drivers"]:
    """Gap over speed [s] of each driver behind a leader of constant speed [m/s]; NaN if the driver's desired speed is
    lower.
    """
    prior = solver.layout.prior
    model = prior.model.of_rows(jnp.asarray(prior.values(state.z, state.truck).T))
    gaps = np.asarray(model.equilibrium_gap(jnp.full(len(state.z), speed))) / speed
    return np.where((np.asarray(model.desired_speed) > speed) & np.isfinite(gaps), gaps, np.nan)


def equilibrium_time_gaps(solver: Solver, state: FitState, options: DiscoverConfig) -> dict[str, Any]:
    """Median over drivers of gap over speed [s] behind a leader of constant speed, by this speed [m/s]."""
    rng = np.random.default_rng(options.seed)
    share = [(1 - options.confidence) / 2, (1 + options.confidence) / 2]
    by_speed: dict[str, Any] = {}
    for speed in SPEEDS:
        gaps = time_gaps(solver, state, speed)
        gaps = gaps[np.isfinite(gaps)]
        if len(gaps) < len(state.z) / 2:
            by_speed[f"{speed:g}"] = None
            continue
        resampled = np.median(rng.choice(gaps, (options.draws, len(gaps))), axis=1)
        low, high = np.quantile(resampled, share).tolist()
        by_speed[f"{speed:g}"] = {"value": float(np.median(gaps)), "low": low, "high": high}
    return by_speed

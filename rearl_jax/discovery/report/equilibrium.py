"""Equilibrium time gaps of calibrated drivers, comparable between models with different parameters."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.config import DiscoverConfig
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.resampling import bounds, resamples

SPEEDS = (10.0, 20.0)
"""Speeds at which equilibrium time gaps are stated [m/s]."""


def time_gaps(solver: Solver, state: FitState, speed: float) -> Float[np.ndarray, " drivers"]:
    """Gap over speed [s] of each driver in equilibrium behind a leader of this constant speed [m/s]; NaN if the
    driver's desired speed is lower.
    """
    prior = solver.layout.prior
    model = prior.model.of_rows(jnp.asarray(prior.values(state.z, state.truck).T))
    gaps = np.asarray(model.equilibrium_gap(jnp.full(len(state.z), speed))) / speed
    return np.where((np.asarray(model.desired_speed) > speed) & np.isfinite(gaps), gaps, np.nan)


def equilibrium_time_gaps(solver: Solver, state: FitState, options: DiscoverConfig) -> dict[str, Any]:
    """Median equilibrium time gap of the drivers whose desired speed is higher, {value, low, high} [s], by the leader's
    speed [m/s]; None if these are fewer than half of the drivers.
    """
    rng = np.random.default_rng(options.seed)
    by_speed: dict[str, Any] = {}
    for speed in SPEEDS:
        values = time_gaps(solver, state, speed)
        values = values[np.isfinite(values)]
        if len(values) < len(state.z) / 2:
            by_speed[f"{speed:g}"] = None
            continue
        drawn = np.median(values[resamples(len(values), options.draws, rng)], axis=1)
        low, high = bounds(drawn, options.confidence).tolist()
        by_speed[f"{speed:g}"] = {"value": float(np.median(values)), "low": low, "high": high}
    return by_speed

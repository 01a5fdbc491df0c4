"""Observation of the policy: the vehicle itself and the four nearest others, as 25 numbers."""

from jaxtyping import Array, Float

from rearl_jax.core.state import TrafficState
from rearl_jax.decision import observation
from rearl_jax.decision.observation import ObservationSpec

RANGES = {"x": 100.0, "y": 16.0, "vx": 30.0, "vy": 30.0}
"""Values that are scaled to 1 [m, m, m/s, m/s], narrower than highway-env's, so that small differences between
neighbours are resolved; y is highway-env's for four lanes of 4 m.
"""

OBSERVATION = ObservationSpec((RANGES["x"], RANGES["y"], RANGES["vx"], RANGES["vy"]), see_behind=True, has_own_x=False)
"""Vehicles ahead and behind; the observer's own x is 0, because it would stay 1 after the first 100 m of the road."""

N_FEATURES = OBSERVATION.n_features
"""Numbers in an observation."""


def observe_neighbours(state: TrafficState) -> Float[Array, "features vehicles scenarios"]:
    """Observation of every vehicle, see `decision.observation.observe_neighbours`."""
    return observation.observe_neighbours(state, OBSERVATION)

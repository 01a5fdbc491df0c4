"""Start values of the calibration of drivers.

The likelihood of a model that is the smaller of a free-road and a following response (Gipps, Krauss, the controllers)
has several maxima: a driver whose calibrated free-road response is always the smaller one says nothing about the
parameters of following, and no small step changes that.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.solver import Solver

OF_FREE_ROAD = ("desired_speed", "max_accel", "speed_gain")
"""Parameters of the models' free-road responses."""

QUICKER = 2.0
"""Factor of the parameters of the free-road response in the second start [-]; following determines the response
there.
"""


def from_best_start(solver: Solver, state: FitState, *, iterations: int, tolerance: float) -> FitState:
    """The state solved from two starts: as given, and with drivers who are quicker on a free road. Each driver goes on
    from the start that made it more likely; other arguments as of `Solver.solve`.
    """
    quicker = _faster_on_free_road(solver.layout.prior)
    states = [state, replaced(state, z=state.z + quicker, mean=state.mean + quicker)]
    solver.solve(states, iterations=iterations, tolerance=tolerance)
    best = min(states, key=lambda solved: solved.objective)
    likelier = _likeliest(states)
    if (likelier == likelier[0]).all() and states[likelier[0]] is best:
        return best
    mixed = replaced(best, z=np.stack([solved.z for solved in states])[likelier, np.arange(len(likelier))])
    solver.solve([mixed], iterations=iterations, tolerance=tolerance)
    return min(best, mixed, key=lambda solved: solved.objective)


def _faster_on_free_road(prior: Prior) -> Float[np.ndarray, " own"]:
    """Differences of the standardised parameters of the second start to those of the first [-]."""
    is_changed = np.isin(prior.names, OF_FREE_ROAD)
    return is_changed * np.log(QUICKER) / prior.spread


def _likeliest(states: Sequence[FitState]) -> np.ndarray:
    """Index of the state that makes each driver most likely."""
    return np.stack([state.penalised() for state in states]).argmax(axis=0)

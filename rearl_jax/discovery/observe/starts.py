"""Start values of the calibration of drivers.

The likelihood of a model that is the smaller of a free-road and a following response (Gipps, Krauss, the controllers)
has several maxima: a driver whose calibrated free-road response is always the smaller one says nothing about the
parameters of following, and no small step changes that.
"""

import numpy as np

from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.solver import Solver

OF_FREE_ROAD = ("desired_speed", "max_accel", "speed_gain")
"""Parameters of the models' free-road responses."""

QUICKER = 2.0
"""Factor of the parameters of the free-road response in the second start [-]; following determines the response
there.
"""


def from_best_start(solver: Solver, state: FitState, *, iterations: int) -> FitState:
    """The state solved from two starts: as given, and with drivers who are quicker on a free road. Each driver goes on
    from the start that made it more likely; `iterations` as of `Solver.solve`.
    """
    prior = solver.layout.prior
    quicker = np.isin(prior.names, OF_FREE_ROAD) * np.log(QUICKER) / prior.spread  # in standardised parameters
    states = [state, replaced(state, z=state.z + quicker, mean=state.mean + quicker)]
    solver.solve(states, iterations=iterations, tolerance=1.0)
    best = min(states, key=lambda solved: solved.objective)
    likelier = np.stack([solved.penalised() for solved in states]).argmax(axis=0)  # start of each driver
    if (likelier == likelier[0]).all() and states[likelier[0]] is best:
        return best
    mixed = replaced(best, z=np.stack([solved.z for solved in states])[likelier, np.arange(len(likelier))])
    solver.solve([mixed], iterations=iterations, tolerance=1.0)
    return min(best, mixed, key=lambda solved: solved.objective)

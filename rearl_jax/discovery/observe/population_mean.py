"""What the estimates of the population's means cost other parameters: part of a change in them can be imitated by
drivers whose means have moved, so it is projected out (Schur complement).

Means are those of standardised parameters, one for cars and one for trucks.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit_state import CLASSES, FitState


@dataclass(frozen=True)
class MeanProjection:
    """Projection of the mean of one class out of some directions of theta, after the drivers' own parameters.

    Attributes:
        members: Drivers of the class.
        coupled: Information shared by the mean and the directions.
        answer: Derivative of the best mean by the directions, with the sign reversed.
        driver_pull: Each driver's part of the score of the mean.
        pull: Score of the mean, with its prior.
    """

    members: Bool[np.ndarray, " drivers"]
    coupled: Float[np.ndarray, "own directions"]
    answer: Float[np.ndarray, "own directions"]
    driver_pull: Float[np.ndarray, "members own"]
    pull: Float[np.ndarray, " own"]


def mean_projections(
    state: FitState,
    prior: Prior,
    block: Float[np.ndarray, "drivers own own"],
    step: Float[np.ndarray, "drivers own"],
    response: Float[np.ndarray, "drivers own directions"],
) -> Iterator[MeanProjection]:
    """Projections of the means that are searched in a state, class by class.

    Args:
        state: A solved state.
        prior: Prior of the drivers' parameters, with that of their means.
        block: Information on each driver's own parameters, with that of the population.
        step: Gradient of the objective by each driver's own parameters, multiplied by the inverse of `block`.
        response: Derivative of each driver's best own parameters by the directions, with the sign reversed.
    """
    if state.holds_population:
        return
    precision, away, located = state.precision, state.away @ state.precision, prior.location_precision
    for c in range(CLASSES):
        members = state.truck == c
        if not members.any():
            continue
        inverse = np.linalg.inv(block[members])
        information = (precision - precision @ inverse @ precision).sum(axis=0) + np.diag(located)
        coupled = precision @ response[members].sum(axis=0)
        driver_pull = step[members] @ precision - away[members]
        pull = located * state.mean[c] + driver_pull.sum(axis=0)
        yield MeanProjection(members, coupled, np.linalg.solve(information, coupled), driver_pull, pull)

"""What a change in some parameters leaves once everything that imitates it is fitted: the drivers' own parameters, and
the means of the population, one for cars and one for trucks (Schur complements).

Drivers' parameters and means are standardised. Parameters other than these are called directions.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit_state import CLASSES, FitState, with_prior


@dataclass(frozen=True)
class OwnProjection:
    """Projection of the drivers' own parameters out of some directions.

    Attributes:
        block: Information on each driver's own parameters, with that of the population.
        coupling: Information shared by each driver's own parameters and the directions.
        step: Gradient of the objective by each driver's own parameters, multiplied by the inverse of `block`.
        response: Derivative of each driver's best own parameters by the directions, with the sign reversed.
        gradient: Gradient of the objective by the directions that each driver leaves.
    """

    block: Float[np.ndarray, "drivers own own"]
    coupling: Float[np.ndarray, "drivers own directions"]
    step: Float[np.ndarray, "drivers own"]
    response: Float[np.ndarray, "drivers own directions"]
    gradient: Float[np.ndarray, "drivers directions"]


def own_projection(
    state: FitState,
    gradient: Float[np.ndarray, "drivers own_and_directions"],
    information: Float[np.ndarray, "drivers own own_and_directions"],
) -> OwnProjection:
    """The projection in a solved state. `gradient` is that of half the squared innovations over their variance,
    `information` that on own parameters, and that shared with the directions.
    """
    n_own = state.z.shape[1]
    block, coupling = with_prior(information[:, :, :n_own], state.precision), information[:, :, n_own:]
    slope = gradient[:, :n_own] + state.away @ state.precision
    solved = np.linalg.solve(block, np.concatenate([slope[:, :, None], coupling], axis=2))
    step, response = solved[:, :, 0], solved[:, :, 1:]
    left = gradient[:, n_own:] - np.einsum("dij,di->dj", coupling, step)
    return OwnProjection(block, coupling, step, response, left)


@dataclass(frozen=True)
class MeanProjection:
    """Projection of the mean of one class out of some directions, after the drivers' own parameters.

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


def mean_projections(state: FitState, prior: Prior, own: OwnProjection) -> Iterator[MeanProjection]:
    """Projections of the means that are searched in a solved state, class by class; `prior` contains theirs."""
    if state.holds_shared:
        return
    precision, away, located = state.precision, state.away @ state.precision, prior.location_precision
    for c in range(CLASSES):
        members = state.truck == c
        if not members.any():
            continue
        inverse = np.linalg.inv(own.block[members])
        information = (precision - precision @ inverse @ precision).sum(axis=0) + np.diag(located)
        coupled = precision @ own.response[members].sum(axis=0)
        driver_pull = own.step[members] @ precision - away[members]
        pull = located * state.mean[c] + driver_pull.sum(axis=0)
        yield MeanProjection(members, coupled, np.linalg.solve(information, coupled), driver_pull, pull)

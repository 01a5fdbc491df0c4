"""What the final model leaves behind: is it noise, or is there more?

Source: Meissner & Glasner, arXiv:2406.06707, for the joint view of states and terms; excess kurtosis as a test of
normality, Jarque & Bera, Int. Stat. Rev. 55 (1987) 163; variance that depends on the situation, Breusch & Pagan,
Econometrica 47 (1979) 1287.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from rearl_jax.core.following import follow
from rearl_jax.discovery.forcing import answers, parameters
from rearl_jax.discovery.measured import Measured
from rearl_jax.discovery.procedure import Search
from rearl_jax.discovery.refit import on_others
from rearl_jax.discovery.residuals import Residuals, residuals_of
from rearl_jax.discovery.solver import Solver
from rearl_jax.discovery.verdict import Adequacy

MOST_ENERGY = 9.0
"""Bound of a squared acceleration over a driver's usual one [-]: no single moment decides."""

OF_LATE = 0.3
"""Time over which a change of what the model wants is looked at [s]."""

REASONABLE = (-5.0, 3.0)
"""What a driver may want [m/s^2]; beyond it, a leader is measured too close."""


def adequacy(solver: Solver, found: Search) -> Adequacy:
    """Moments of the final model's innovations, and the candidate that is most surprising still.

    Misjudged gaps and old decisions, which nothing else confirms, are asked of the other drivers as well.
    """
    world, last = found.last.world, found.rounds[-1]
    (before,) = solver.innovations([found.first.world])
    everybody = residuals_of(solver, [world, *on_others(solver, found.checked, [found.last])], [found.last, found.last])
    left = everybody[0]
    surprise = left.innovation
    weight = world.data.weight
    variance = (surprise**2 * weight).sum() / weight.sum()
    lag = world.data.stride
    pair = weight[lag:] * weight[:-lag]
    neighbours = (surprise[lag:] * surprise[:-lag] * pair).sum() / pair.sum()
    name = max(last.surprise, key=lambda key: last.surprise[key])
    return Adequacy(
        kurtosis=kurtosis(surprise, weight),
        kurtosis_deviation=float(np.sqrt(24.0 / weight.sum())),
        kurtosis_before=kurtosis(before, weight),
        autocorrelation=float(neighbours / variance),
        unequal_noise=unequal_noise(surprise, world.data),
        misjudgement=misjudgement(everybody),
        staleness=staleness(everybody),
        remaining=(name, float(last.surprise[name])),
    )


def kurtosis(surprise: Float[np.ndarray, "steps pieces"], weight: Float[np.ndarray, "steps pieces"]) -> float:
    """Excess kurtosis of the innovations that count [-]."""
    square, fourth = ((surprise**power * weight).sum() / weight.sum() for power in (2, 4))
    return float(fourth / square**2 - 3)


def unequal_noise(surprise: Float[np.ndarray, "steps pieces"], data: Measured) -> dict[str, float]:
    """How surely the size of innovations depends on the situation: standard normal figures where it does not.

    Args:
        surprise: Innovations [m].
        data: The drivers.
    """
    around = data.around
    gap = np.maximum(around.leader_rear - (data.smooth + data.length / 2), 1.0)
    situations = {
        "gap": np.log(gap),
        "speed": data.smooth_speed,
        "approach_rate": np.abs(data.smooth_speed - around.leader_speed),
    }

    relative = surprise**2 / data.driver_mean(surprise**2)[data.driver]
    return {name: _surely(_votes(relative, values, data)) for name, values in situations.items()}


def misjudgement(parts: Sequence[Residuals]) -> float:
    """How surely what drivers do beside the model grows with what a misjudged gap would make them do.

    An error of the gap in proportion to it changes the acceleration by the gap times the model's answer to it. Noise of
    the acceleration does not depend on that answer, and is even damped by it: negative figures.

    Args:
        parts: What the final model leaves, of each part of the drivers.
    """

    def by_misjudging(left: Residuals) -> np.ndarray:
        gap, answer = np.asarray(left.stimulus().gap), answers(left).x
        return (answer * gap) ** 2

    return _energy_grows_with(by_misjudging, parts)


def staleness(parts: Sequence[Residuals]) -> float:
    """How surely what drivers do beside the model grows with how much of late what the model wants has changed.

    Who decides now and then, and holds on to it in between, is behind by a random time; what that does is in proportion
    to the change. Behind by always the same time he has a delay, which leaves nothing of the kind once it is known, and
    noise of the acceleration does not ask what has changed.

    Args:
        parts: What the final model leaves, of each part of the drivers.
    """

    def by_being_late(left: Residuals) -> np.ndarray:
        data = left.world.data
        wanted = np.asarray(follow(left.stimulus(), parameters(left), (), (), data.dt)[0], float).clip(*REASONABLE)
        ago = max(1, round(OF_LATE / data.dt))
        change = np.zeros_like(wanted)
        change[ago:] = wanted[ago:] - wanted[:-ago]
        return change**2

    return _energy_grows_with(by_being_late, parts)


def _energy_grows_with(energy: Callable[[Residuals], np.ndarray], parts: Sequence[Residuals]) -> float:
    """How surely the energy of what drivers do beside the model grows with another one, of each part."""
    return _surely(np.concatenate([_energy_votes(energy(left), left) for left in parts]))


def _energy_votes(square: Float[np.ndarray, "steps pieces"], left: Residuals) -> Float[np.ndarray, " drivers"]:
    """How much the energy of what each driver does beside the model grows with another one; nothing where no moment
    counts.
    """
    data = left.world.data
    counts = data.weight > 0
    if not counts.any():
        return np.zeros(data.n_drivers)
    usual, most = np.quantile(square[counts], [0.9, 0.98])
    stake = np.minimum(square, most) / max(float(usual), 1e-12)
    energy = left.acceleration**2
    energy = np.minimum(energy / np.maximum(data.driver_mean(energy), 1e-12)[data.driver], MOST_ENERGY)
    return _votes(energy, stake, data)


def _votes(
    energy: Float[np.ndarray, "steps pieces"], situation: Float[np.ndarray, "steps pieces"], data: Measured
) -> Float[np.ndarray, " drivers"]:
    """How much one grows with the other; drivers are compared with themselves, and each has one vote."""

    def off(values: np.ndarray) -> np.ndarray:
        return values - data.driver_mean(values)[data.driver]

    return np.bincount(data.driver, (off(energy) * off(situation) * data.weight).sum(axis=0), data.n_drivers)


def _surely(votes: Float[np.ndarray, " drivers"]) -> float:
    """How surely the votes do not cancel, in standard deviations [-]."""
    return float(votes.sum() / max(float(np.sqrt((votes**2).sum())), 1e-12))

"""What simulations of other drivers say of a candidate: evidence one time step ahead and a minute ahead must agree.

Noise that is not as the observer takes it may look like an effect from one time step to the next; a simulation adds up
what an effect does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.closed_loop import gap_errors
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import Trial, bounded_gains
from rearl_jax.discovery.thresholds import THRESHOLDS

DRAWS = 1000

ROUNDING = 1e-9
"""Change of the squared error that is of the arithmetic, as a share of it [-]."""


def simulated(solver: Solver, base: FitState, accepted: Sequence[Trial]) -> tuple[list[Trial], list[Trial]]:
    """Trials that simulations of the checked drivers bear out, the best first, and those that they contradict; `base`
    are these drivers without any of them.
    """
    leading = accepted[: THRESHOLDS.leading_simulated]
    if not leading:
        return [], []
    before, *errors = gap_errors(solver, [base, *(trial.other for trial in leading)])
    asked = [
        replace(trial, simulated=simulated_gains(before, after, base.data))
        for trial, after in zip(leading, errors, strict=True)
    ]
    borne = simulated_gains(before, before * np.sqrt(1 + THRESHOLDS.borne_growth), base.data)
    agreed, contradicted = [], []
    for trial in asked:
        assert trial.simulated is not None
        (contradicted if is_contradicted(trial.simulated, borne) else agreed).append(trial)
    return sorted(agreed, key=lambda trial: -trial.overall), contradicted


def simulated_gains(
    before: Float[np.ndarray, " drivers"], after: Float[np.ndarray, " drivers"], data: Measured
) -> Float[np.ndarray, " drivers"]:
    """Log-likelihood that each driver's simulation gains [nats] where its gap error [m] was `before` and is `after`.

    Errors of a simulation last as long as it takes a driver to take them back, so a minute shows few that are
    independent; errors as small as the measurement's say nothing. Source: likelihood of normal errors of unknown size.
    """
    independent = data.driver_minutes * 60 / THRESHOLDS.simulated_memory
    least = data.noise**2
    gains = 0.5 * independent * np.log((before**2 + least) / (after**2 + least))
    return bounded_gains(gains, data)


def is_contradicted(gains: Float[np.ndarray, " drivers"], borne: Float[np.ndarray, " drivers"], seed: int = 0) -> bool:
    """True if in most resamples of drivers their simulations lose more than is borne [nats].

    What each says is bounded: one driver whom a model loses altogether does not outvote all others.
    """
    return bool((_means(gains - borne, seed) < 0).mean() > THRESHOLDS.contradiction_share)


def share_worse(
    before: Float[np.ndarray, " drivers"],
    after: Float[np.ndarray, " drivers"],
    borne: float = ROUNDING,
    seed: int = 0,
) -> float:
    """Share of resamples of drivers in which the squared error is larger after than before [-], by more than a share
    `borne` of what it was.
    """
    return float((_means(after**2 - before**2, seed) > borne * (before**2).mean()).mean())


def _means(values: Float[np.ndarray, " drivers"], seed: int) -> Float[np.ndarray, " draws"]:
    """Means over resamples of drivers."""
    drawn = np.random.default_rng(seed).integers(0, len(values), (DRAWS, len(values)))
    return values[drawn].mean(axis=1)

"""Error of a model on drivers that took no part in finding it, before and after, against what no model could do better.

Every model has the same freedom on these drivers: each finds its own five parameters, everything else stays as it was
found on others. Then it is simulated behind the measured leader, without correction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.closed_loop import FARTHEST, calibrated_to_gap, simulated_error
from rearl_jax.discovery.observe.fit import Fit, on_others
from rearl_jax.discovery.observe.fit_state import FitState, copied
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.null import behind_noisy_drive, position_errors

NOISY_RUNS, FLOOR_RUNS = 6, 3
"""Realisations of the drivers' noise that the energy score and the floor rest on."""

MEASURES = (
    "gap_rmse",
    "gap_nrmse",
    "speed_rmse",
    "gap_rmse_uncalibrated",
    "one_step",
    "energy_score",
    "log_likelihood",
)
"""Measures of each driver: closed-loop gap error [m], the same over the root mean square gap [-] and the speed
error [m/s], the driver's parameters calibrated to the gap as is usual; the gap error with the parameters that predict
best from one time step to the next [m]; error in predicting the next position [m]; energy score of noisy
simulations [m]; log-likelihood [nats].
"""


@dataclass(frozen=True)
class ModelErrors:
    """Errors of one model, driver by driver.

    Attributes:
        by_driver: Each measure of each driver.
        floor: Closed-loop gap error that the drivers' own noise makes alone [m], by driver.
    """

    by_driver: dict[str, Float[np.ndarray, " drivers"]]
    floor: Float[np.ndarray, " drivers"]


def model_errors(solver: Solver, data: Measured, fits: Mapping[str, Fit], seed: int) -> dict[str, ModelErrors]:
    """Errors of fitted models on other drivers, with the same noise for all."""
    states = on_others(solver, data, list(fits.values()))
    return {name: _errors(solver, state, fit, seed) for (name, fit), state in zip(fits.items(), states, strict=True)}


def _errors(solver: Solver, state: FitState, fit: Fit, seed: int) -> ModelErrors:
    data = state.data
    calibrated = calibrated_to_gap(solver, state)
    deviation, uncalibrated = (simulated_error(solver, one) for one in (calibrated, state))
    (innovation,) = solver.innovations([state])
    rng = np.random.default_rng(seed)
    noisy = [behind_noisy_drive(solver, state, fit.noise, rng) for _ in range(NOISY_RUNS)]
    drawn = np.clip(np.stack(noisy), -FARTHEST, FARTHEST)
    gap = data.around.leader_rear - (data.smooth + data.length / 2)
    mean = data.driver_mean
    rmse = np.sqrt(mean(deviation**2))
    pairs = [(i, j) for i in range(len(drawn)) for j in range(i)]
    spread = np.mean([np.sqrt(mean((drawn[i] - drawn[j]) ** 2)) for i, j in pairs], axis=0)
    away = np.mean([np.sqrt(mean(one**2)) for one in drawn], axis=0)
    return ModelErrors(
        {
            "gap_rmse": rmse,
            "gap_nrmse": rmse / np.sqrt(mean(gap**2)),
            "speed_rmse": speed_error(deviation, data),
            "gap_rmse_uncalibrated": np.sqrt(mean(uncalibrated**2)),
            "one_step": np.sqrt(mean(innovation**2)),
            "energy_score": away - spread / 2,
            "log_likelihood": state.penalised(),
        },
        _floor(solver, calibrated, fit, seed),
    )


def speed_error(deviation: Float[np.ndarray, "steps pieces"], data: Measured) -> Float[np.ndarray, " drivers"]:
    """Root mean square speed error of each driver [m/s], from measured less simulated positions [m]."""
    ahead = deviation - (data.y - data.smooth)
    # Backward: what comes after the last time step of a piece is padding, in which nobody drives.
    speed = np.diff(ahead, axis=0, prepend=ahead[:1]) / data.dt
    return np.sqrt(data.driver_mean(speed**2))


def _floor(solver: Solver, state: FitState, fit: Fit, seed: int) -> Float[np.ndarray, " drivers"]:
    """Gap error [m] that remains where the model is right: its own noisy drives, calibrated to in the same way."""
    data, squares = state.data, []
    rng = np.random.default_rng([seed, 1])
    for _ in range(FLOOR_RUNS):
        behind = behind_noisy_drive(solver, state, fit.noise, rng)
        driven = data.y - np.clip(behind, -FARTHEST, FARTHEST)
        driven = driven + position_errors(fit.noise, driven.shape, data.dt, rng)
        again = copied(state, pieces=replace(state.pieces, y=driven))
        solver.solve([again], iterations=20, tolerance=0.1)
        squares.append(data.driver_mean(simulated_error(solver, again) ** 2))
    # The middle one: now and then noise alone drives somebody into the leader, where no model follows.
    return np.sqrt(np.median(squares, axis=0))


def pooled(values: Float[np.ndarray, " drivers"], measure: str) -> float:
    """One figure of all drivers: root mean square of errors, sum of log-likelihoods, mean of scores."""
    if measure == "log_likelihood":
        return float(values.sum())
    if measure == "energy_score":
        return float(values.mean())
    return float(np.sqrt(np.mean(values**2)))


def with_interval(
    values: Sequence[Float[np.ndarray, " drivers"]], measure: str, confidence: float, draws: int, seed: int
) -> list[dict[str, float]]:
    """Figures of several models with intervals from resampling drivers, the same ones for all, as in verdict.json; that
    of the difference of the first two comes last.
    """
    rng = np.random.default_rng(seed)
    n = len(values[0])
    samples = [rng.integers(0, n, n) for _ in range(draws)]
    share = [(1 - confidence) / 2, (1 + confidence) / 2]
    resampled = [np.array([pooled(errors[sample], measure) for sample in samples]) for errors in values]
    figures = [pooled(errors, measure) for errors in values]
    if len(values) > 1:
        figures.append(figures[1] - figures[0])
        resampled.append(resampled[1] - resampled[0])
    ends = [np.quantile(drawn, share).tolist() for drawn in resampled]
    return [{"value": value, "low": low, "high": high} for value, (low, high) in zip(figures, ends, strict=True)]

"""Variation of the time gap within a driver, and the energy score of simulations with and without it.

The variation is estimated on the fitted drivers and scored on the report drivers.

Entry `time_gap_variation` of the verdict: {sd, time, noise_share, start_share, time_gap, energy_score: {before,
constant, varying, change, change_share}}. `sd` is the standard deviation of log T within a driver [-], T the time gap,
`time` its correlation time [s], `noise_share` the share of the acceleration noise that remains with it [-],
`start_share` the share of the driver's initial deviation from its usual log T that is variation [-] (the rest is
departure from equilibrium), and `time_gap` the standard deviation of the median driver's time gap [s]. `energy_score`
contains mean energy scores of the report drivers [m] as figures {value, low, high}: of the calibrated model (`before`)
and of the final model with a `constant` and with a `varying` time gap, all for the second halves of drives, simulated
with the driver's parameters from the first half; `energy_score` is null if no drive is long enough. `change` is
`varying` minus `before`, and `change_share` the relative change in the geometric mean over drivers.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.discovery.search.headway import (
    CONSTANT_TIME_GAP,
    SMALLEST_SCORE,
    TimeGapVariation,
    energy_scores,
    later_halves,
)
from rearl_jax.document.document import Section
from rearl_jax.document.table import Cell, Row, Table, number, percent, sentence


def variation_block(
    solver: Solver,
    calibrated_on: tuple[Fit, Measured],
    final_on: tuple[Fit, Measured],
    variation: TimeGapVariation,
    resampling: Resampling,
) -> dict[str, Any]:
    """Entry `time_gap_variation` of the verdict: from the calibrated model with the report drivers, and from the final
    model with these drivers, their clocks corrected with that model. The seed of the resampling is also used for the
    noise.
    """

    def scores_of(fit: Fit, halves: FitState | None, varied: TimeGapVariation) -> Float[np.ndarray, " drivers"]:
        return np.empty(0) if halves is None else energy_scores(solver, halves, fit, resampling.seed, varied)

    (calibrated, reported), (final, corrected) = calibrated_on, final_on
    halves_calibrated = halves_final = later_halves(solver, reported, calibrated)
    if final is not calibrated or corrected is not reported:
        halves_final = later_halves(solver, corrected, final)
    scores = {"before": scores_of(calibrated, halves_calibrated, CONSTANT_TIME_GAP)}
    scores["constant"] = scores["before"] if final is calibrated else scores_of(final, halves_final, CONSTANT_TIME_GAP)
    is_constant = variation == CONSTANT_TIME_GAP
    scores["varying"] = scores["constant"] if is_constant else scores_of(final, halves_final, variation)
    state, prior = final.state, solver.layout.prior
    time_gaps = prior.values(state.z, state.truck)[:, prior.names.index("time_gap")]
    return entry_of(variation, float(np.median(time_gaps)), scores, resampling)


def entry_of(
    variation: TimeGapVariation,
    median_time_gap: float,
    scores: Mapping[str, Float[np.ndarray, " drivers"]],
    resampling: Resampling,
) -> dict[str, Any]:
    """Entry `time_gap_variation` from the report drivers' energy scores [m] and the median driver's time gap [s]."""
    # The standard deviation of a log-normal variable with median m: m sqrt(exp(sd^2) (exp(sd^2) - 1)).
    exp_variance = np.exp(variation.sd**2)
    return {
        "sd": variation.sd,
        "time": variation.time,
        "noise_share": variation.noise_share,
        "start_share": variation.start_share,
        "time_gap": float(median_time_gap * np.sqrt(exp_variance * (exp_variance - 1))),
        "energy_score": _figures(scores, resampling) if len(scores["before"]) else None,
    }


def _figures(
    scores: Mapping[str, Float[np.ndarray, " drivers"]], resampling: Resampling
) -> dict[str, dict[str, float]]:
    """Mean energy scores [m] and their change."""
    drawn = {name: resampling.drawn(values, np.mean) for name, values in scores.items()}
    figures = {name: resampling.figure(values) for name, values in drawn.items()}
    figures["change"] = resampling.figure(drawn["varying"] - drawn["before"])
    ratio = np.log(np.maximum(scores["varying"], SMALLEST_SCORE) / np.maximum(scores["before"], SMALLEST_SCORE))
    figures["change_share"] = resampling.figure(np.exp(resampling.drawn(ratio, np.mean)) - 1)
    return figures


def variation_section(verdict: Mapping[str, Any]) -> Section:
    """Section on the variation with the energy scores; empty if it was not estimated."""
    title, variation = "Time gaps that vary within a driver", verdict.get("time_gap_variation")
    if variation is None or variation["energy_score"] is None:
        return Section(title)
    if variation["sd"] or variation["noise_share"] < 1:
        words = (
            f"according to the fitted drivers, a time gap varies with a standard deviation of "
            f"{number(variation['time_gap'])} s and a correlation time of {number(variation['time'])} s, and "
            f"{percent(variation['noise_share'])} of the acceleration noise remains; simulations of the final model "
            "vary in the same way"
        )
    else:
        words = "simulations with a varying time gap are not significantly closer to the fitted drivers"
    how = (
        "The energy score is the mean distance of noisy simulations from the measured drive minus half "
        "their mean distance from each other. It is lowest for the correct spread; lower is better. Second halves of "
        "drives are simulated with the driver's parameters from the first half."
    )
    labels = {"before": "calibrated model", "constant": "final model", "varying": "final model, varying time gap"}
    labels |= {"change": "change from the calibrated model to the varying time gap"}
    share = variation["energy_score"]["change_share"]
    rows = tuple(
        Row(label, (Cell(number(score["value"])), Cell(f"{number(score['low'])} to {number(score['high'])}")))
        for label, score in ((label, variation["energy_score"][key]) for key, label in labels.items())
    )
    ends = f"{percent(share['low'])} to {percent(share['high'])}"
    rows += (Row("relative change, geometric mean", (Cell(percent(share["value"])), Cell(ends))),)
    table = Table("Energy score of drivers not used in the fit", ("mean [m]", "interval"), rows)
    return Section(title, (f"{sentence(words)} {how}",), (table,), is_folded=True)

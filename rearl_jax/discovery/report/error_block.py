"""Entry `error` of the verdict: errors of the report drivers before and after effects were added, with intervals over
drivers.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.report.errors import MEASURES, ModelErrors
from rearl_jax.discovery.report.protocols import IN_SAMPLE, PREDICTING, PROTOCOL_MEASURES, PROTOCOLS, ProtocolErrors
from rearl_jax.discovery.resampling import Pool, Resampling

MAIN_MEASURE = "gap_rmse"
"""Measure that the verdict states first: the closed-loop gap error."""

IDM = "idm"
"""Name of the calibrated IDM without any effect among the models whose errors are compared."""

LEAST_REMOVABLE = 0.02
"""Share of the squared error before [-] that must lie above that of the drivers' own noise for an explained share to be
stated.
"""


def root_mean_square(values: np.ndarray, axis: int) -> np.ndarray:
    """Root mean square along an axis."""
    return np.sqrt(np.mean(values**2, axis=axis))


STATISTICS: dict[str, Pool] = {"mean": np.mean, "median": np.median, "pooled": root_mean_square}
"""Statistics over drivers: mean and median of their errors, and the root mean square, which few drivers may dominate.
"""

POOLS: dict[str, Pool] = {"log_likelihood": np.sum, "energy_score": np.mean}
"""Statistic over drivers by measure; the root mean square for measures not listed."""


def error_block(errors: Mapping[str, ModelErrors], resampling: Resampling) -> dict[str, Any]:
    """Entry `error` of the verdict, from errors by model: `before`; `after` if effects were added, or `oracle` if the
    true effect was given; IDM for comparison.
    """
    final_name = "after" if "after" in errors else "oracle" if "oracle" in errors else "before"
    first, final, idm = errors["before"], errors[final_name], errors.get(IDM)
    figures = {
        name: resampling.change(first.by_driver[name], final.by_driver[name], POOLS.get(name, root_mean_square))
        for name in MEASURES
    }
    main, pooled = figures[MAIN_MEASURE], partial(resampling.drawn, pool=root_mean_square)
    before, after = (pooled(errors_of_model.by_driver[MAIN_MEASURE]) for errors_of_model in (first, final))
    noise = pooled(final.floor)
    return {
        "measure": MAIN_MEASURE,
        "protocol": IN_SAMPLE,
        "n_drivers": len(final.floor),
        "before": main["before"],
        "after": main["after"] if final_name != "oracle" else None,
        "change": main["change"],
        "floor": resampling.figure(np.minimum(noise, after)),
        "noise_alone": resampling.figure(noise),
        "oracle": main["after"] if final_name == "oracle" else None,
        "explained_share": explained_share(before, after, noise, resampling.confidence),
        "all": figures,
        "protocols": {
            name: _protocol(
                first.protocols[name], final.protocols[name], None if idm is None else idm.protocols[name], resampling
            )
            for name in PROTOCOLS
        },
        "response_time": {
            name: None if model.responses is None else model.responses.figure(resampling)
            for name, model in (("before", first), ("after", final))
        },
    }


def lowers_predicting_errors(error: Mapping[str, Any]) -> bool:
    """True if, by an entry `error`, the mean gap error of the report drivers is significantly lower after effects were
    added under a protocol that predicts, and larger under none.
    """
    of_protocols = (error["protocols"][name] for name in PREDICTING)
    changes = [figures[MAIN_MEASURE]["mean"]["change"] for figures in of_protocols if figures is not None]
    is_lower = any(change["high"] < 0 for change in changes)
    return is_lower and all(change["value"] <= 0 for change in changes)


def explained_share(
    before: Float[np.ndarray, " figures"],
    after: Float[np.ndarray, " figures"],
    noise: Float[np.ndarray, " figures"],
    confidence: float,
) -> float | None:
    """Share of the squared error above the floor that the added effects remove [-], from 0 to 1. The floor is the error
    from the drivers' own noise alone, at most the error after. Each error is the figure of all drivers, then those of
    resamples.

    None if the error was at the floor before. Also None if, with this confidence, the noise alone causes a larger error
    than that after: then the noise model is wrong, and the removable error is unknown.
    """
    if np.mean(noise[1:] > after[1:]) > (1 + confidence) / 2:
        return None
    above = before[0] ** 2 - min(noise[0], after[0]) ** 2
    if above <= LEAST_REMOVABLE * before[0] ** 2:
        return None
    return float(np.clip((before[0] ** 2 - after[0] ** 2) / above, 0.0, 1.0))


def _protocol(
    first: ProtocolErrors | None, final: ProtocolErrors | None, idm: ProtocolErrors | None, resampling: Resampling
) -> dict[str, Any] | None:
    """Figures under one protocol (source of the driver's parameters); None if no driver could be tested."""
    if first is None or final is None:
        return None
    figures: dict[str, Any] = {"n_drivers": len(final.driver), "left_out": final.left_out}
    for measure in PROTOCOL_MEASURES:
        before, after = first.by_driver[measure], final.by_driver[measure]
        others = {"population": first.population[measure]}
        if idm is not None:
            others[IDM] = idm.by_driver[measure]
        figures[measure] = {
            statistic: _compared(before, after, others, pool, resampling) for statistic, pool in STATISTICS.items()
        }
    return figures


def _compared(
    before: np.ndarray, after: np.ndarray, others: Mapping[str, np.ndarray], pool: Pool, resampling: Resampling
) -> dict[str, dict[str, float]]:
    """Figures before and after, with their absolute and relative change; then each of `others` (errors of other models
    on the same drives, by name) with the relative difference of the error after from it.
    """
    drawn_before, drawn_after = resampling.drawn(before, pool), resampling.drawn(after, pool)
    relative_change = resampling.figure(drawn_after / drawn_before - 1)
    figures = resampling.change(before, after, pool) | {"change_share": relative_change}
    for name, values in others.items():
        other = resampling.drawn(values, pool)
        figures |= {name: resampling.figure(other), f"{name}_share": resampling.figure(drawn_after / other - 1)}
    return figures

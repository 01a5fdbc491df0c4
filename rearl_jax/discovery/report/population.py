"""The calibrated drivers as a population: medians, differences, and parameters that the data do not determine.

Entry `population` of the verdict: {parameter: {value, unit, spread, identified, at_bound}}. `value` is the median over
drivers, `spread` the standard deviation of the logarithm between drivers, `identified` the mean share of the variance
between drivers that the data of one driver remove, and `at_bound` the share of drivers at a bound of the parameter.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.observe.uncertainty import shares_at_bound
from rearl_jax.discovery.report.words import with_unit
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.document.document import Section
from rearl_jax.document.table import Cell, Row, Table, number, percent, sentence, spoken


def population_block(solver: Solver, state: FitState) -> dict[str, dict[str, Any]]:
    """Entry `population` of the verdict, for the fitted drivers of a calibrated model."""
    prior, truck = solver.layout.prior, state.truck
    values = np.exp(np.median(np.log(prior.values(state.z, truck)), axis=0))
    determined = 1 - np.mean((np.sqrt(state.own_variance) / state.spread) ** 2, axis=0)
    at_bound = shares_at_bound(solver, state)
    rows = zip(prior.names, prior.units, values, prior.spread * state.spread, determined, at_bound, strict=True)
    return {
        name: {
            "value": float(value),
            "unit": unit,
            "spread": float(spread),
            "identified": float(np.clip(share, 0.0, 1.0)),
            "at_bound": float(bound),
        }
        for name, unit, value, spread, share, bound in rows
    }


def population_section(verdict: Mapping[str, Any]) -> Section:
    """Section with the population, and the parameters that must not be interpreted; empty without a population."""
    title, population = "Drivers of the calibrated model", verdict.get("population")
    if not population:
        return Section(title)
    rows, notes = [], []
    for name, entry in population.items():
        cells = (
            number(entry["value"]),
            number(entry["spread"]),
            percent(entry["identified"]),
            percent(entry["at_bound"]),
        )
        rows.append(Row(with_unit(name, entry["unit"]), tuple(map(Cell, cells))))
        if entry["identified"] < THRESHOLDS.least_identified:
            notes.append(f"{spoken(name)} is not identified here: its value is that of the prior")
        if entry["at_bound"] > THRESHOLDS.most_at_bound:
            notes.append(
                f"{spoken(name)} is at its bound in {percent(entry['at_bound'])} of drivers: its value has no meaning"
            )
    words = (
        "Parameters that a driver's data do not determine are shrunk to the population mean. Spread: standard "
        "deviation of the logarithm between drivers. Determined by data: mean share of the variance between drivers "
        "that one driver's data remove. Parameters can compensate for each other; equilibrium time gaps cannot."
    )
    table = Table(title, ("median driver", "spread", "determined by data", "at a bound"), tuple(rows))
    return Section(title, (words,), (table,), tuple(map(sentence, notes)), is_folded=True)

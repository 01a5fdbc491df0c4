"""Maps: mean acceleration residual (what the model leaves unexplained) as a function of one variable or of two.

A map over one variable is a curve through knots at quantiles of the variable, fitted to the innovations (one-step
prediction errors of the position) of all drivers at once, see `observe.forcing`. Its confidence band comes from
resampling drivers; its share and gain come from curves fitted to half of the drivers and evaluated on the other half.
A map over two variables is a plane, divided into cells of constant residual.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.forcing import DriverScores
from rearl_jax.discovery.resampling import bounds
from rearl_jax.discovery.search.variables import Variable

KNOTS = 7
"""Knots of a curve."""

OUTER = 0.02
"""Share of the time steps beyond each of the outer knots [-]."""

LEAST_SHARE = 0.005
"""Share of the time steps that a value of a discrete variable, or a cell of a plane, must have to be shown [-]."""

CURVE_DEVIATION = 1.0
"""Prior standard deviation of a curve's values [m/s^2]; it only matters for values that the data do not determine."""

CELL_DEVIATION = 0.2
"""Prior standard deviation of the cells of a plane [m/s^2]; smaller, because each contains few time steps."""

HALVINGS = 10
"""Random divisions of the drivers into halves."""

CELLS = 7
"""Cells of a plane in each direction."""


@dataclass(frozen=True)
class Basis:
    """Knots of the curve over one variable.

    Attributes:
        variable: The variable.
        knots: Knots in the unit of the variable; for a discrete variable, its values.
        share: Mean weight of each knot over all time steps [-].
    """

    variable: Variable
    knots: Float[np.ndarray, " knots"]
    share: Float[np.ndarray, " knots"]

    def columns(self, values: Float[np.ndarray, "steps pieces"]) -> Float[np.ndarray, "knots steps pieces"]:
        """Weight of each knot [-], by linear interpolation, or 1 at the nearest value of a discrete variable."""
        if self.variable.is_discrete:
            nearest = np.abs(values[None] - self.knots[:, None, None]).argmin(axis=0)
            return (nearest[None] == np.arange(len(self.knots))[:, None, None]).astype(float)
        unit = np.eye(len(self.knots))
        return np.stack([np.interp(values, self.knots, row) for row in unit])


@dataclass(frozen=True)
class Curve:
    """A map over one variable.

    Attributes:
        basis: Basis of its variable.
        value, low, high: Mean acceleration residual at the knots, less its mean over all time steps [m/s^2].
        acts_on: `acceleration`, or `time_gap` if a curve of the time gap has the larger gain.
        share: Share of the variance of the acceleration residual that the curve explains on held-out drivers [-].
        gain: Gain of log-likelihood by the curve on held-out drivers [nats].
    """

    basis: Basis
    value: Float[np.ndarray, " knots"]
    low: Float[np.ndarray, " knots"]
    high: Float[np.ndarray, " knots"]
    acts_on: str
    share: float
    gain: float

    @property
    def reach(self) -> float:
        """Largest minus smallest value [m/s^2]."""
        return float(np.ptp(self.value))


def basis_of(variable: Variable, weight: Float[np.ndarray, "steps pieces"]) -> Basis | None:
    """Knots at quantiles of a variable; None for a variable that hardly changes."""
    used = variable.values[weight > 0]
    if variable.is_discrete:
        values, counts = np.unique(np.round(used), return_counts=True)
        knots = values[counts > LEAST_SHARE * len(used)]
    else:
        knots = np.unique(np.quantile(used, np.linspace(OUTER, 1 - OUTER, KNOTS)))
        is_apart = np.diff(knots, prepend=-np.inf) > 0.02 * max(np.ptp(knots), 1e-9)
        knots = knots[is_apart]
    if len(knots) < 2 or np.ptp(knots) < 1e-6:
        return None
    without_share = Basis(variable, knots, np.zeros(len(knots)))
    return replace(without_share, share=without_share.columns(used[:, None]).mean(axis=(1, 2)))


def fitted(
    scores: DriverScores, drivers: Float[np.ndarray, " drivers"] | None = None, prior_deviation: float = CURVE_DEVIATION
) -> Float[np.ndarray, " columns"]:
    """Coefficients of the columns that explain the innovations best (ridge regression), with a prior standard deviation
    for each [m/s^2]; `drivers` are the weights of the drivers [-], None for equal ones.
    """
    gram, score = (
        (scores.gram.sum(axis=0), scores.score.sum(axis=0))
        if drivers is None
        else (np.tensordot(drivers, scores.gram, 1), drivers @ scores.score)
    )
    return np.linalg.solve(gram + scores.variance / prior_deviation**2 * np.eye(len(score)), score)


def curve_of(
    basis: Basis, scores: Mapping[str, tuple[DriverScores, DriverScores]], confidence: float, draws: int, seed: int
) -> Curve:
    """The map over one variable, from scores of its knots' columns on the innovations and on the acceleration residual,
    for a curve that adds `acceleration` and for one that changes the `time_gap`. The band has the given confidence [-]
    and comes from `draws` resamples of drivers.
    """
    rng = np.random.default_rng(seed)
    on_innovations = scores["acceleration"][0]
    n = len(on_innovations.score)
    counts = rng.multinomial(n, np.full(n, 1 / n), draws)
    drawn = centred(np.stack([fitted(on_innovations, row) for row in counts.astype(float)]), basis)
    low, high = bounds(drawn, confidence)
    on_held_out = {acts_on: on_other_halves(*pair, np.random.default_rng(seed)) for acts_on, pair in scores.items()}
    acts_on = max(on_held_out, key=lambda key: on_held_out[key][1])
    return Curve(basis, centred(fitted(on_innovations), basis), low, high, acts_on, *on_held_out[acts_on])


def centred(values: Float[np.ndarray, "*draws knots"], basis: Basis) -> Float[np.ndarray, "*draws knots"]:
    """Values at the knots less their mean over all time steps."""
    return values - (values @ basis.share)[..., None] / basis.share.sum()


def on_other_halves(
    on_innovations: DriverScores, on_acceleration: DriverScores, rng: np.random.Generator
) -> tuple[float, float]:
    """Share of the acceleration residual's variance [-] and log-likelihood [nats] that a fit to half of the drivers
    explains in the other half, averaged over random divisions.
    """
    n, shares, gains = len(on_innovations.score), [], []
    for _ in range(HALVINGS):
        half = np.zeros(n)
        half[rng.permutation(n)[: n // 2]] = 1.0
        fits = [(fitted(on_innovations, fit), 1.0 - fit) for fit in (half, 1.0 - half)]
        explained, explained_acceleration = (
            sum(_explained(scores, values, held_out) for values, held_out in fits)
            for scores in (on_innovations, on_acceleration)
        )
        gains.append(explained / (2 * on_innovations.variance))
        shares.append(explained_acceleration / max(on_acceleration.square.sum(), 1e-12))
    return float(np.mean(shares)), float(np.mean(gains))


def _explained(
    scores: DriverScores, values: Float[np.ndarray, " columns"], drivers: Float[np.ndarray, " drivers"]
) -> float:
    """Reduction of the sum of squares of the drivers (each with a weight of 0 or 1) by the coefficients `values`."""
    return float(drivers @ (2 * scores.score @ values - (scores.gram @ values) @ values))


@dataclass(frozen=True)
class Plane:
    """A map over two variables.

    Attributes:
        across, up: The horizontal and the vertical variable.
        across_edges, up_edges: Edges of the cells, in the units of the variables.
        value: Mean acceleration residual [m/s^2]; NaN in cells with too few time steps.
    """

    across: Variable
    up: Variable
    across_edges: Float[np.ndarray, " across_edges"]
    up_edges: Float[np.ndarray, " up_edges"]
    value: Float[np.ndarray, "up across"]


def edges_of(variable: Variable, weight: Float[np.ndarray, "steps pieces"]) -> Float[np.ndarray, " edges"]:
    """Edges of cells with equally many time steps, outliers excluded."""
    edges = np.quantile(variable.values[weight > 0], np.linspace(OUTER / 2, 1 - OUTER / 2, CELLS + 1))
    return edges + np.arange(CELLS + 1) * 1e-9  # so that equal quantiles do not give equal edges


def cells(
    values: Sequence[Float[np.ndarray, "steps pieces"]], edges: Sequence[Float[np.ndarray, " edges"]]
) -> Float[np.ndarray, "cells steps pieces"]:
    """1 in the cell of a time step, else 0; the index of the first (horizontal) variable varies fastest."""
    across, up = (np.clip(np.searchsorted(e, v) - 1, 0, CELLS - 1) for v, e in zip(values, edges, strict=True))
    return ((up * CELLS + across)[None] == np.arange(CELLS**2)[:, None, None]).astype(float)


def plane_of(
    variables: Sequence[Variable],
    edges: Sequence[np.ndarray],
    share: Float[np.ndarray, " cells"],
    scores: DriverScores,
) -> Plane:
    """The map over two variables, horizontal and vertical; `share` is that of the time steps in each cell [-]."""
    values = fitted(scores, prior_deviation=CELL_DEVIATION)
    values = values - values @ share
    value = np.where(share > LEAST_SHARE, values, np.nan).reshape(CELLS, CELLS)
    return Plane(variables[0], variables[1], edges[0], edges[1], value)

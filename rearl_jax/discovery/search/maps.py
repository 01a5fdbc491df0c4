"""Maps: mean acceleration residual as a function of one variable or two, with confidence bands and gains on other
drivers.

A map is a curve through knots at quantiles of its variable, fitted to the innovations of all drivers at once
(`forcing`). Its band comes from resampling drivers; its share and gain come from curves fitted to half of the drivers
and evaluated on the other half.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.forcing import DriverScores
from rearl_jax.discovery.search.variables import Variable

KNOTS = 7
"""Knots of a curve."""

OUTER = 0.02
"""Share of the time steps beyond each of the outer knots [-]."""

LEAST_SHARE = 0.005
"""Share of the time steps that a value of a discrete variable, or a field of a plane, must have to be shown [-]."""

USUAL = 1.0
"""Prior standard deviation of a curve's values [m/s^2]; it only matters for values that the data do not determine."""

USUAL_IN_FIELDS = 0.2
"""Prior standard deviation of the fields of a plane [m/s^2], each of which contains few time steps."""

HALVINGS = 10
"""Random divisions of the drivers into halves."""

FIELDS = 7
"""Fields (cells) of a plane in each direction."""


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
        share: Share of the variance of the acceleration residual that it explains on held-out drivers [-].
        gain: Gain of log-likelihood on held-out drivers [nats].
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
        apart = np.diff(knots, prepend=-np.inf) > 0.02 * max(np.ptp(knots), 1e-9)
        knots = knots[apart]
    if len(knots) < 2 or np.ptp(knots) < 1e-6:
        return None
    empty = Basis(variable, knots, np.zeros(len(knots)))
    return Basis(variable, knots, empty.columns(used[:, None]).mean(axis=(1, 2)))


def fitted(
    scores: DriverScores, drivers: Float[np.ndarray, " drivers"] | None = None, prior_deviation: float = USUAL
) -> Float[np.ndarray, " columns"]:
    """Values of the columns that explain the innovations best (ridge regression).

    Args:
        scores: Scores of the columns.
        drivers: Weight of each driver [-]; None for equal weights.
        prior_deviation: Prior standard deviation of each value.
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
    """The map of one variable, from scores of its columns on innovations and on the acceleration residual."""
    rng = np.random.default_rng(seed)
    on_innovations = scores["acceleration"][0]
    n = len(on_innovations.score)
    counts = rng.multinomial(n, np.full(n, 1 / n), draws)
    drawn = centred(np.stack([fitted(on_innovations, row) for row in counts.astype(float)]), basis)
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)
    on_held_out = {acts_on: on_other_halves(*pair, np.random.default_rng(seed)) for acts_on, pair in scores.items()}
    acts_on = max(on_held_out, key=lambda key: on_held_out[key][1])
    return Curve(basis, centred(fitted(on_innovations), basis), low, high, acts_on, *on_held_out[acts_on])


def centred(values: Float[np.ndarray, "*draws knots"], basis: Basis) -> Float[np.ndarray, "*draws knots"]:
    """Values at the knots less their mean over all time steps."""
    return values - (values @ basis.share)[..., None] / basis.share.sum()


def on_other_halves(scores: DriverScores, seen: DriverScores, rng: np.random.Generator) -> tuple[float, float]:
    """Share of the acceleration residual's variance [-] and log-likelihood [nats] that a fit to half of the drivers
    explains in the other half, averaged over random divisions.
    """
    n, shares, gains = len(scores.score), [], []
    for _ in range(HALVINGS):
        half = np.zeros(n)
        half[rng.permutation(n)[: n // 2]] = 1.0
        parts = [(fitted(scores, fit), 1.0 - fit) for fit in (half, 1.0 - half)]
        gains.append(sum(_less(scores, values, scored) for values, scored in parts) / (2 * scores.variance))
        shares.append(sum(_less(seen, values, scored) for values, scored in parts) / max(seen.square.sum(), 1e-12))
    return float(np.mean(shares)), float(np.mean(gains))


def _less(scores: DriverScores, values: np.ndarray, drivers: np.ndarray) -> float:
    """Reduction of the sum of squares of the given drivers."""
    return float(drivers @ (2 * scores.score @ values - (scores.gram @ values) @ values))


@dataclass(frozen=True)
class Plane:
    """A map over two variables.

    Attributes:
        across, up: The variables.
        across_edges, up_edges: Edges of the fields, in the units of the variables.
        value: Mean acceleration residual [m/s^2]; NaN in fields with too few time steps.
    """

    across: Variable
    up: Variable
    across_edges: Float[np.ndarray, " across_edges"]
    up_edges: Float[np.ndarray, " up_edges"]
    value: Float[np.ndarray, "up across"]


def edges_of(variable: Variable, weight: Float[np.ndarray, "steps pieces"]) -> Float[np.ndarray, " edges"]:
    """Edges of fields with equally many time steps, outliers excluded."""
    edges = np.quantile(variable.values[weight > 0], np.linspace(OUTER / 2, 1 - OUTER / 2, FIELDS + 1))
    return edges + np.arange(FIELDS + 1) * 1e-9


def fields(
    values: Sequence[Float[np.ndarray, "steps pieces"]], edges: Sequence[Float[np.ndarray, " edges"]]
) -> Float[np.ndarray, "fields steps pieces"]:
    """Indicator of the field that contains each time step; the index of the first variable varies fastest."""
    across, up = (np.clip(np.searchsorted(e, v) - 1, 0, FIELDS - 1) for v, e in zip(values, edges, strict=True))
    return ((up * FIELDS + across)[None] == np.arange(FIELDS**2)[:, None, None]).astype(float)


def plane_of(
    variables: Sequence[Variable],
    edges: Sequence[np.ndarray],
    share: Float[np.ndarray, " fields"],
    scores: DriverScores,
) -> Plane:
    """The map of two variables; `share` is the share of the time steps in each field [-]."""
    values = fitted(scores, prior_deviation=USUAL_IN_FIELDS)
    values = values - values @ share
    value = np.where(share > LEAST_SHARE, values, np.nan).reshape(FIELDS, FIELDS)
    return Plane(variables[0], variables[1], edges[0], edges[1], value)


def ranked(curves: Mapping[str, Curve]) -> list[Curve]:
    """The maps, the largest gain on other drivers first."""
    return sorted(curves.values(), key=lambda curve: -curve.gain)

"""All maps of one model's residual, and the variables that the open-ended finder selects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.forcing import (
    DriverScores,
    acceleration_derivatives,
    added_acceleration,
    driver_scores,
    innovation_and_acceleration_scores,
    plain_scores,
)
from rearl_jax.discovery.observe.residuals import Residuals
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.finder import Group, Selected, stability_selection
from rearl_jax.discovery.search.maps import (
    Basis,
    Curve,
    Plane,
    basis_of,
    centred,
    curve_of,
    edges_of,
    fields,
    fitted,
    plane_of,
)
from rearl_jax.discovery.search.shapes import shape_of, shape_words
from rearl_jax.discovery.search.variables import Variable, variables_of

PLANES = (("gap", "approach_rate"), ("position", "time"))
"""Pairs of variables, horizontal and vertical, of the planes (maps over two variables)."""

CURVE_SCALE = {"acceleration": 0.3, "time_gap": 0.3}
"""Standard deviation of the prior of a curve's values in the finder: as for the curves of the screen [m/s^2], [-]."""


@dataclass(frozen=True)
class Chart:
    """Knots of curves and edges of planes, the same for all models and parts of the data.

    Attributes:
        bases: Bases of the variables.
        edges: Edges of the planes.
    """

    bases: tuple[Basis, ...]
    edges: dict[str, np.ndarray]

    def groups(self) -> list[Group]:
        """The curves as groups of columns for the finder: accelerations, then time gaps."""
        curves = [(basis, acts_on) for acts_on in CURVE_SCALE for basis in self.bases]
        stops = np.cumsum([len(basis.knots) for basis, _ in curves])
        return [
            Group(basis.variable.name, acts_on, np.arange(stop - len(basis.knots), stop), CURVE_SCALE[acts_on])
            for (basis, acts_on), stop in zip(curves, stops, strict=True)
        ]

    def weights(self, variables: Mapping[str, Variable]) -> Float[np.ndarray, "columns steps pieces"]:
        """Weights of the knots of all curves, concatenated."""
        return np.concatenate([basis.columns(variables[basis.variable.name].values) for basis in self.bases])


@dataclass(frozen=True)
class PartScores:
    """Scores of the drivers of one part of the data.

    Attributes:
        curves: Scores on the columns of all groups.
        seen: Scores of these columns on the acceleration residual, for shares of its variance.
        planes: Scores on the fields (cells) of each plane.
        shares: Shares of the time steps in the fields of each plane [-].
    """

    curves: DriverScores
    seen: DriverScores
    planes: dict[tuple[str, str], DriverScores]
    shares: dict[tuple[str, str], np.ndarray]


@dataclass(frozen=True)
class Atlas:
    """Maps of one model.

    Attributes:
        curves: Maps by variable.
        planes: Planes by pair of variables.
        selected: Variables selected by the finder, the most stable first.
        shapes: Description of each curve's shape, by variable.
    """

    curves: dict[str, Curve]
    planes: dict[tuple[str, str], Plane]
    selected: list[Selected]
    shapes: dict[str, str]


def chart_of(residuals: Residuals) -> Chart:
    """Knots and edges at the quantiles of one part of the data."""
    weight, variables = residuals.state.data.weight, variables_of(residuals)
    bases = [basis_of(variable, weight) for variable in variables.values()]
    edges = {name: edges_of(variables[name], weight) for pair in PLANES for name in pair}
    return Chart(tuple(basis for basis in bases if basis is not None), edges)


def part_scores(residuals: Residuals, chart: Chart) -> PartScores:
    """Scores of the drivers of one part of the data."""
    variables, derivatives, data = variables_of(residuals), acceleration_derivatives(residuals), residuals.state.data
    weights = chart.weights(variables)
    planes, shares = {}, {}
    used = data.weight > 0
    for pair in PLANES:
        indicators = fields([variables[name].values for name in pair], [chart.edges[name] for name in pair])
        planes[pair], shares[pair] = driver_scores(indicators, residuals, derivatives), indicators[:, used].mean(axis=1)
    columns = np.concatenate([weights, weights * derivatives.own[residuals.prior.names.index("time_gap")]])
    return PartScores(*innovation_and_acceleration_scores(columns, residuals, derivatives), planes, shares)


def joined(parts: Sequence[DriverScores]) -> DriverScores:
    """Scores of several parts of the data together."""
    gram, score, square = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("gram", "score", "square")
    )
    drivers = np.array([len(part.square) for part in parts])
    return DriverScores(gram, score, square, float(drivers @ [part.variance for part in parts] / drivers.sum()))


def atlas_of(
    chart: Chart, parts: Sequence[PartScores], n_chosen_from: int, confidence: float, draws: int, seed: int
) -> Atlas:
    """All maps. The finder uses the first `n_chosen_from` parts; drivers are resampled `draws` times for bands."""
    curves, seen = joined([part.curves for part in parts]), joined([part.seen for part in parts])
    groups = chart.groups()
    maps, shapes = {}, {}
    for basis in chart.bases:
        name, of_variable = basis.variable.name, [group for group in groups if group.variable == basis.variable.name]
        pairs = {group.acts_on: (curves.of(group.columns), seen.of(group.columns)) for group in of_variable}
        maps[name] = curve_of(basis, pairs, confidence, draws, seed)
        shapes[name] = shape_words(maps[name], shape_of(maps[name], pairs["acceleration"][0]))
    variables = {basis.variable.name: basis.variable for basis in chart.bases}
    planes = {}
    for pair in PLANES:
        if all(name in variables for name in pair):
            share = np.mean([part.shares[pair] for part in parts], axis=0)
            plane_scores = joined([part.planes[pair] for part in parts])
            edges = [chart.edges[name] for name in pair]
            planes[pair] = plane_of([variables[name] for name in pair], edges, share, plane_scores)
    finder_scores = joined([part.curves for part in parts[:n_chosen_from]])
    return Atlas(maps, planes, stability_selection(finder_scores, groups, seed), shapes)


def added_curves(solver: Solver, residuals: Residuals, chart: Chart) -> dict[str, np.ndarray]:
    """The acceleration of the added effects [m/s^2] as a curve over every variable, at its knots, for comparison with
    the maps before. Empty if no added effect changes the acceleration.
    """
    added = added_acceleration(solver, residuals)
    if np.abs(added).max(initial=0.0) < 1e-6:
        return {}
    scores = plain_scores(added, chart.weights(variables_of(residuals)), residuals, acceleration_derivatives(residuals))
    return {
        basis.variable.name: centred(fitted(scores.of(group.columns)), basis)
        for basis, group in zip(chart.bases, chart.groups(), strict=False)
    }

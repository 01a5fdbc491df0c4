"""Maps of one model's acceleration residual over one variable (curves) and over two (planes), and the variables that
stability selection finds without naming an effect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.forcing import (
    DriverScores,
    acceleration_derivatives,
    driver_scores,
    innovation_and_acceleration_scores,
    model_acceleration,
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
    cells,
    centred,
    curve_of,
    edges_of,
    fitted,
    plane_of,
)
from rearl_jax.discovery.search.shapes import shape_words
from rearl_jax.discovery.search.variables import Variable, variables_of

PLANES = (("gap", "approach_rate"), ("position", "time"))
"""Horizontal and vertical variable of each plane."""


@dataclass(frozen=True)
class Grid:
    """Knots of the curve over each variable (`bases`), and edges of the planes' cells by variable, the same for all
    models and parts of the data.
    """

    bases: tuple[Basis, ...]
    edges: dict[str, np.ndarray]

    def groups(self) -> list[Group]:
        """One group of design-matrix columns per curve: first curves that add acceleration, then those that change the
        time gap.
        """
        curves = [(basis, acts_on) for acts_on in ("acceleration", "time_gap") for basis in self.bases]
        stops = np.cumsum([len(basis.knots) for basis, _ in curves])
        return [
            Group(basis.variable.name, acts_on, np.arange(stop - len(basis.knots), stop))
            for (basis, acts_on), stop in zip(curves, stops, strict=True)
        ]

    def knot_columns(self, variables: Mapping[str, Variable]) -> Float[np.ndarray, "columns steps pieces"]:
        """Weight of each knot of each curve in every time step [-]."""
        return np.concatenate([basis.columns(variables[basis.variable.name].values) for basis in self.bases])


@dataclass(frozen=True)
class PartScores:
    """Scores of the drivers of one part of the data.

    Attributes:
        curves: Scores of the columns of `Grid.groups` on the innovations.
        curves_on_acceleration: Scores of the same columns on the acceleration residual, for shares of its variance.
        planes: Scores of the cells of each plane on the innovations.
        shares: Share of the time steps in each cell of each plane [-].
    """

    curves: DriverScores
    curves_on_acceleration: DriverScores
    planes: dict[tuple[str, str], DriverScores]
    shares: dict[tuple[str, str], np.ndarray]


@dataclass(frozen=True)
class Atlas:
    """Maps of one model.

    Attributes:
        curves: Curves by variable.
        planes: Planes by pair of variables.
        selected: How often stability selection selected each variable, in the order of `stability_selection`.
        shapes: Shape of each curve in words, by variable.
    """

    curves: dict[str, Curve]
    planes: dict[tuple[str, str], Plane]
    selected: list[Selected]
    shapes: dict[str, str]


def grid_of(residuals: Residuals) -> Grid:
    """Knots and edges at the quantiles of the variables in one part of the data."""
    weight, variables = residuals.state.data.weight, variables_of(residuals)
    bases = [basis_of(variable, weight) for variable in variables.values()]
    edges = {name: edges_of(variables[name], weight) for pair in PLANES for name in pair}
    return Grid(tuple(basis for basis in bases if basis is not None), edges)


def part_scores(residuals: Residuals, grid: Grid) -> PartScores:
    """Scores of the drivers of one part of the data."""
    variables, derivatives, data = variables_of(residuals), acceleration_derivatives(residuals), residuals.state.data
    by_knot = grid.knot_columns(variables)
    planes, shares = {}, {}
    used = data.weight > 0
    for pair in PLANES:
        indicators = cells([variables[name].values for name in pair], [grid.edges[name] for name in pair])
        planes[pair], shares[pair] = driver_scores(indicators, residuals, derivatives), indicators[:, used].mean(axis=1)
    by_time_gap = derivatives.own[residuals.prior.names.index("time_gap")]
    columns = np.concatenate([by_knot, by_knot * by_time_gap])
    return PartScores(*innovation_and_acceleration_scores(columns, residuals, derivatives), planes, shares)


def joined(parts: Sequence[DriverScores]) -> DriverScores:
    """Scores of several parts of the data together."""
    gram, score, square = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("gram", "score", "square")
    )
    drivers = np.array([len(part.square) for part in parts])
    return DriverScores(gram, score, square, float(drivers @ [part.variance for part in parts] / drivers.sum()))


def atlas_of(
    grid: Grid, parts: Sequence[PartScores], n_finder_parts: int, confidence: float, draws: int, seed: int
) -> Atlas:
    """All maps of one model. Variables are selected with the first `n_finder_parts` parts of the drivers; bands of
    curves have the given confidence [-] and come from `draws` resamples of drivers.
    """
    curves = joined([part.curves for part in parts])
    curves_on_acceleration = joined([part.curves_on_acceleration for part in parts])
    groups = grid.groups()
    maps, shapes = {}, {}
    for basis in grid.bases:
        name, of_variable = basis.variable.name, [group for group in groups if group.variable == basis.variable.name]
        pairs = {
            group.acts_on: (curves.of(group.columns), curves_on_acceleration.of(group.columns)) for group in of_variable
        }
        maps[name] = curve_of(basis, pairs, confidence, draws, seed)
        shapes[name] = shape_words(maps[name], pairs["acceleration"][0])
    variables = {basis.variable.name: basis.variable for basis in grid.bases}
    planes = {}
    for pair in PLANES:
        if all(name in variables for name in pair):
            share = np.mean([part.shares[pair] for part in parts], axis=0)
            plane_scores = joined([part.planes[pair] for part in parts])
            edges = [grid.edges[name] for name in pair]
            planes[pair] = plane_of([variables[name] for name in pair], edges, share, plane_scores)
    finder_scores = joined([part.curves for part in parts[:n_finder_parts]])
    return Atlas(maps, planes, stability_selection(finder_scores, groups, seed), shapes)


def added_curves(solver: Solver, residuals: Residuals, grid: Grid) -> dict[str, np.ndarray]:
    """Acceleration by the added effects [m/s^2] as a curve over every variable, at its knots, for comparison with the
    maps of the model without these effects. Empty if no added effect changes the acceleration.
    """
    added = model_acceleration(solver, residuals.state, residuals.stimulus(), of_effects=True)
    if np.abs(added).max(initial=0.0) < 1e-6:
        return {}
    columns = grid.knot_columns(variables_of(residuals))
    scores = plain_scores(added, columns, residuals, acceleration_derivatives(residuals))
    # The first groups, one per basis, are the curves that add acceleration; `zip` leaves out those of the time gap.
    return {
        basis.variable.name: centred(fitted(scores.of(group.columns)), basis)
        for basis, group in zip(grid.bases, grid.groups(), strict=False)
    }

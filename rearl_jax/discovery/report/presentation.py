"""Residuals, maps, figures and page of a discovery; they do not influence the verdict.

A map is the acceleration residual as a curve over one variable, a plane the same over two; an atlas contains all of one
model.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.discovery.discover import Discovery, PageData
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.residuals import Residuals, residuals_of
from rearl_jax.discovery.report import figures, map_figures
from rearl_jax.discovery.report.document import document_of
from rearl_jax.discovery.report.tables import driver_table
from rearl_jax.discovery.report.words import is_lane_choice
from rearl_jax.discovery.search.atlas import Atlas, added_curves, atlas_of, grid_of, part_scores
from rearl_jax.document.document import data_sources
from rearl_jax.document.html import page_of
from rearl_jax.results import Study

PARTS = ("fitted", "checked", "reported")
"""Parts of the drivers, in the order of the residuals."""

N_SELECTING_PARTS = 2
"""Number of the first parts from which sparse regression selects variables; the reported part is excluded."""

KEPT_EVERY = 0.2
"""Time between rows of residuals.parquet, rounded to time steps with a measurement [s]."""

DRAWS = 300
"""Resamples of drivers for the bands of maps."""


def present(study: Study, discovery: Discovery) -> None:
    """Writes `residuals.parquet`, `maps.parquet`, `planes.parquet`, the figures and `page.html` of a discovery with
    page data into the study folder.
    """
    page_data, verdict, options = discovery.page_data, discovery.verdict, discovery.config.discover
    assert page_data is not None
    solver, search, generated = page_data.solver, page_data.search, verdict["data"]["generated"]
    residuals = all_residuals(page_data)
    grid = grid_of(residuals["before"][0])
    atlases = {
        model: atlas_of(
            grid,
            [part_scores(of_part, grid) for of_part in of_parts],
            N_SELECTING_PARTS,
            options.confidence,
            DRAWS,
            options.seed,
        )
        for model, of_parts in residuals.items()
    }
    added = added_curves(solver, residuals["after"][0], grid) if search.added else {}
    # Only an effect that depends on one variable can be drawn as a curve over it.
    variables_of_added = {trial.candidate.variables for trial in search.added}
    added = {name: values for name, values in added.items() if (name,) in variables_of_added}
    maps = map_table(atlases, added)
    for name, table in (("residuals", residual_table(residuals)), ("maps", maps), ("planes", plane_table(atlases))):
        study.write_table(name, table, seeds=f"discover.seed={options.seed}")

    candidates = [row for row in verdict["candidates"] if not is_lane_choice(row)]
    of_fitted, of_reported = ({model: of_parts[index] for model, of_parts in residuals.items()} for index in (0, -1))
    images = {
        "maps": map_figures.draw_maps(atlases, added, generated=generated),
        "evidence": figures.draw_evidence(candidates, search.null, generated=generated),
        "closed_loop": figures.draw_errors(page_data.errors, generated=generated),
        "example": figures.draw_example(of_reported, page_data.errors, generated=generated),
        "innovations": figures.draw_innovations(of_fitted, generated=generated),
        "planes": map_figures.draw_planes(atlases, generated=generated),
        "parameters": figures.draw_parameters(driver_table(solver, search), solver.layout.prior, generated=generated),
    }
    for name, png in images.items():
        study.write_bytes(f"{name}.png", png)
    document = document_of(discovery.config, verdict, maps, data_sources(page_data.parts.infos))
    study.write_text("page.html", page_of(document, discovery.config, images, data_id=discovery.data_id))


def all_residuals(page_data: PageData) -> dict[str, list[Residuals]]:
    """Residuals of the fitted, checked and report drivers, `before` and, if effects were added, `after`."""
    solver, search, parts = page_data.solver, page_data.search, page_data.parts
    models = {"before": (search.before, (parts.checked, parts.reported))}
    if search.added or search.clocks is not None:
        models["after"] = search.last, (search.checked, page_data.reported)
    residuals = {}
    for model, (fit, others) in models.items():
        states = [fit.state, *(recalibrated(solver, part, fit) for part in others)]
        residuals[model] = [residuals_of(solver, state, fit.noise) for state in states]
    return residuals


def residual_table(residuals: Mapping[str, Sequence[Residuals]]) -> pd.DataFrame:
    """Residuals in time steps that count, about KEPT_EVERY apart, driver by driver; given for PARTS by model."""
    tables = []
    for index, part in enumerate(PARTS):
        data = residuals["before"][index].state.data
        every = data.stride * max(1, round(KEPT_EVERY / (data.stride * data.dt)))  # time steps
        kept = np.argwhere(data.weight[::every].T > 0)
        piece, t = kept[:, 0], kept[:, 1] * every
        table: dict[str, Any] = {
            "part": part,
            "driver": data.driver[piece].astype(np.int32),
            "vehicle": data.vehicle[piece].astype(np.int32),
            "recording": data.recording[piece].astype(np.int32),
            "time": data.surroundings.time[t, piece].astype(np.float32),
        }
        for model, of_model in residuals.items():
            for name in ("innovation", "acceleration", "gap"):
                table[f"{name}_{model}"] = getattr(of_model[index], name)[t, piece].astype(np.float32)
        tables.append(pd.DataFrame(table))
    return pd.concat(tables, ignore_index=True)


def map_table(atlases: Mapping[str, Atlas], added: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """Table of the maps, a row per knot, with their gains and how often sparse regression selects their variable;
    `added` is the added acceleration at the knots [m/s^2], by variable.
    """
    tables = []
    for model, atlas in atlases.items():
        selected = {selection.variable: selection for selection in atlas.selected}
        for name, curve in atlas.curves.items():
            basis, selection = curve.basis, selected[name]
            table = {
                "model": model,
                "variable": name,
                "unit": basis.variable.unit,
                "knot": basis.knots,
                "value": curve.value,
                "low": curve.low,
                "high": curve.high,
                "added": pd.array(added.get(name, [None] * len(basis.knots)), "Float64"),
                "acts_on": curve.acts_on,
                "share": curve.share,
                "gain": curve.gain,
                "selected": selection.frequency,
                "selected_first": selection.first,
                "shape": atlas.shapes[name],
            }
            tables.append(pd.DataFrame(table))
    return pd.concat(tables, ignore_index=True)


def plane_table(atlases: Mapping[str, Atlas]) -> pd.DataFrame:
    """Table of the planes, a row per cell; no value if the cell has too few time steps."""
    tables = []
    for model, atlas in atlases.items():
        for plane in atlas.planes.values():
            up, across = np.indices(plane.value.shape).reshape(2, -1)
            table = {
                "model": model,
                "across": plane.across.name,
                "across_low": plane.across_edges[across],
                "across_high": plane.across_edges[across + 1],
                "up": plane.up.name,
                "up_low": plane.up_edges[up],
                "up_high": plane.up_edges[up + 1],
                "value": pd.array(plane.value.ravel(), "Float64"),
            }
            tables.append(pd.DataFrame(table))
    return pd.concat(tables, ignore_index=True)

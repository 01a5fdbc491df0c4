"""The task `rearl export`: drivers for other programs.

Writes into the study folder the file of the target (`types.add.xml`, `drivers.json` or `ControllerCatalog.xosc`),
`said.parquet` (translation of each part of the model) and, with export.compare=true, `round_trip.parquet` and
`flow.parquet` (see `rearl_jax.export.check`), then `config.json` and, last of all, `summary.json`.
"""

from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config.evaluation import Variant
from rearl_jax.config.export import ExportTask, Target
from rearl_jax.data.recordings import data_id, is_generated
from rearl_jax.document.terminal import print_document
from rearl_jax.export.check import flow, round_trip
from rearl_jax.export.document import document_of
from rearl_jax.export.highway_env import to_highway_env
from rearl_jax.export.leaders import leader_speeds
from rearl_jax.export.openscenario import to_openscenario
from rearl_jax.export.platoon import STEPS_PER_SECOND
from rearl_jax.export.sumo import to_sumo
from rearl_jax.export.sumo_platoon import check_sumo
from rearl_jax.export.translations import translation_table
from rearl_jax.models.file import model_id, read_model
from rearl_jax.models.population import Population, lane_changing_of, population_of_keys, population_of_model
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study

WRITERS = {
    Target.sumo: ("types.add.xml", to_sumo),
    Target.highway_env: ("drivers.json", to_highway_env),
    Target.openscenario: ("ControllerCatalog.xosc", to_openscenario),
}
"""Name of the file of each target, and the function that makes its content."""


def run(config: ExportTask) -> dict[str, Any]:
    """The summary: `target`, `car_following`, `n_types`, `n_said`, `n_unsaid`, and with export.compare=true the figures
    of the round trip (`difference_mean`, `difference_largest` [m], with `_effects` those with effects and noise) and of
    the flow (`h_speed`, `h_headway` of SUMO, with `_floor` those of other drivers of this package).

    Raises:
        MissingInputError, BadModelError: There is no such model, or it cannot be read.
        InvalidInputError: The target has no such car-following model, or the recordings have too few first vehicles.
        ModuleNotFoundError: libsumo or scenariogeneration is needed and not installed.
    """
    options = config.export
    if options.compare:
        check_sumo()
    population = population_of_task(config)
    file, write = WRITERS[config.to]
    write = partial(to_sumo, extended=True) if options.eidm else write
    exported = write(population, options.n_types, options.seed)
    read = [] if config.model is None else [model_id(config.model)]
    read += [data_id(config.data)] if options.compare else []
    generated = options.compare and is_generated(config.data)
    study = Study(config.results.root, config.study, config, "export", ", ".join(read) or None, generated=generated)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    path = study.write_text(file, exported.text)
    translations = translation_table(exported.translations)
    tables = {"said": translations}
    if options.compare:
        speed = leader_speeds(config.data, options.n_leaders, options.seconds)
        tables["round_trip"] = round_trip(population, speed, options.n_followers, options.seed, extended=options.eidm)
        tables["flow"] = flow(population, exported.text, speed, options.n_followers, options.seed)
    for name, table in tables.items():
        study.write_table(name, table, seeds=f"export.seed={options.seed}")
    n_said = sum(part.where is not None for part in exported.translations)
    summary = {
        "target": config.to.name,
        "car_following": population.car_following,
        "n_types": options.n_types,
        "n_said": n_said,
        "n_unsaid": len(translations) - n_said,
        **_figures(tables),
    }
    print_document(document_of(config, summary, tables, str(path), generated=generated))
    study.write_summary(summary)
    return summary


def population_of_task(config: ExportTask) -> Population:
    """The drivers that are exported.

    Raises:
        MissingInputError, BadModelError: There is no such model, or it cannot be read.
        InvalidInputError: The drivers are highway-env's own.
    """
    dtype = np.dtype(np.float64)
    if config.model is not None:
        return population_of_model(
            read_model(config.model),
            dtype,
            with_effects=config.variant is Variant.repaired,
            lane_changing=lane_changing_of(config.mobil, dtype, STEPS_PER_SECOND),
            ticks_per_second=STEPS_PER_SECOND,
        )
    population = population_of_keys(config.driver, config.mobil, dtype, STEPS_PER_SECOND)
    if population is None:
        fault = "has the values of highway-env's own drivers, so there is nothing to export"
        remedy = "change keys of driver or mobil, choose another driver=NAME, or name a model"
        raise InvalidInputError(Problem("nothing-to-export", fault, remedy, key="driver", value=config.driver.model))
    return population


def _figures(tables: dict[str, pd.DataFrame]) -> dict[str, float]:
    """Figures of the comparison; none without it."""
    if "round_trip" not in tables:
        return {}
    rows = tables["round_trip"].to_dict("records")
    figures = {}
    for suffix, row in zip(("", "_effects"), rows, strict=False):  # the second row is there only with effects or noise
        figures |= {f"difference_mean{suffix}": row["difference"], f"difference_largest{suffix}": row["largest"]}
    traffic = {row["traffic"]: row for row in tables["flow"].to_dict("records")}
    for name, suffix in (("SUMO", ""), ("here, other drivers", "_floor")):
        figures |= {f"{column}{suffix}": traffic[name][column] for column in ("h_speed", "h_headway")}
    return figures

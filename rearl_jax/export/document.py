"""Document of an export: the place of every part of the model in the other program, and a comparison of both."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config.export import ExportTask
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import table_of

PROGRAMS = {"sumo": "SUMO", "highway_env": "highway-env", "openscenario": "OpenSCENARIO"}
"""Names of the targets as they are written."""


def document_of(
    config: ExportTask, summary: Mapping[str, Any], tables: Mapping[str, pd.DataFrame], path: str, *, generated: bool
) -> Document:
    """The document of an export: figures of summary.json, tables by name, `path` of the file for the other program."""
    program = PROGRAMS[summary["target"]]
    translations = tables["said"]
    columns = {"what": "part of the model", "where": f"in {program}", "remark": "remark"}
    parts = table_of(f"Parts of the model in {program}", translations, columns)
    sections = [Section("Parts of the model", tables=(parts,))]
    verdict = (
        f"{summary['n_types']} drivers for {program} in {path}; "
        f"{summary['n_unsaid']} of {len(translations)} parts have no counterpart"
    )
    if "round_trip" in tables:
        sections.append(_comparison(config, tables))
        verdict += (
            f"; gaps behind the same leaders differ by {summary['difference_mean']:.3f} m on average, "
            f"{summary['difference_largest']:.2f} m at most"
        )
    return Document(f"Export to {program}", f"{verdict}.", tuple(sections), "export", generated=generated)


def _comparison(config: ExportTask, tables: Mapping[str, pd.DataFrame]) -> Section:
    options = config.export
    trip = {
        "compared": "the same drivers in both",
        "gap": "mean gap [m]",
        "difference": "mean difference [m]",
        "first": "of the first follower [m]",
        "last": "of the last follower [m]",
        "largest": "largest [m]",
        "crashed": "crashed in SUMO, share",
    }
    traffic = {
        "traffic": "traffic",
        "speed": "speed [m/s]",
        "speed_sd": "its SD",
        "headway": "time headway [s]",
        "headway_sd": "its SD",
        "h_speed": "Hellinger distance of speeds",
        "h_headway": "of headways",
    }
    platoons = f"{options.n_leaders} measured leaders, {options.n_followers} followers each, {options.seconds} s"
    return Section(
        "Comparison",
        tables=(
            table_of(f"Absolute differences between gaps in SUMO and here: {platoons}", tables["round_trip"], trip),
            table_of("Drivers that SUMO draws from the file beside drivers drawn here", tables["flow"], traffic),
        ),
        notes=(
            "SUMO ran with --step-method.ballistic; both with steps of 0.1 s, without lane changes",
            "distances are to the first row; the distance of other drivers shows the effect of the random draw alone",
        ),
    )

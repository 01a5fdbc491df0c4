"""Document of the study of stability: analysis compared with simulation, flow, collisions, recordings."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import percent, table_of
from rearl_jax.evaluation.remarks import Remarks

TABLES = ("amplification", "ring", "flow", "queue", "traffic", "measured")
"""Names of the tables, in the order in which they are made."""

CAPTIONS = {
    "amplification": "Amplitude of a follower's speed over its leader's: lines by the linear analysis, points "
    "simulated; above 1 disturbances grow from vehicle to vehicle.",
    "fundamental_diagram": "Flow on rings by density, from equal spacing (filled) and from a jam (open).",
}
"""Captions by the figures' names."""


VERDICT_COLUMNS = {
    "model": "",
    "string_unstable": "string-unstable",
    "largest_amplification": "largest amplification [-]",
    "collides": "collides",
    "collisions_per_vehicle_hour": "collisions [1/(vehicle h)]",
    "recording_string_unstable": "recording unstable",
    "recording_collides": "recording collides",
    "statements": "where the recording is not",
}
"""Keys of the objects in verdict.json that are shown, with their headings."""


def summary_of(tables: Mapping[str, pd.DataFrame], verdict: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Flat figures: `n_models`, `n_unstable` and `n_colliding` models, `n_stated` (models with a statement in
    verdict.json); `n_rings` and `n_agree` (rings on which analysis and simulation agree), `largest_difference`
    between both in a platoon's amplification [-]; `n_bands` compared with recordings and `n_equivalent` of them. None
    for values that were not computed.
    """
    ring, measured = tables["ring"], tables["measured"]
    difference = np.abs(tables["amplification"]["difference"].to_numpy(float))
    return {
        "n_models": len(verdict),
        "n_unstable": sum(model["string_unstable"] is True for model in verdict),
        "n_colliding": sum(model["collides"] for model in verdict),
        "n_stated": sum(bool(model["statements"]) for model in verdict),
        "n_rings": len(ring),
        "n_agree": ring["agree"].tolist().count(True),
        "largest_difference": float(difference.max()) if difference.size else None,
        "n_bands": len(measured),
        "n_equivalent": measured["equivalent"].tolist().count(True),
    }


def document_of(
    tables: Mapping[str, pd.DataFrame],
    verdict: Sequence[Mapping[str, Any]],
    remarks: Remarks,
    *,
    margin: float,
    generated: bool,
) -> Document:
    """The document of a study: tables by name, content of verdict.json, and `margin` of the equivalence tests."""
    summary = summary_of(tables, verdict)
    sections = [
        _verdicts(verdict, remarks),
        _platoons(tables["amplification"]),
        _rings(tables["ring"]),
        _flow(tables["flow"], tables["queue"], tables["traffic"]),
    ]
    if not tables["measured"].empty:
        sections.append(_measured(tables["measured"], margin))
    n_platoons = sum(model["string_unstable"] is not None for model in verdict)
    text = (
        f"Of {summary['n_models']} models, {summary['n_unstable']} of {n_platoons} with platoons are string-unstable "
        f"and {summary['n_colliding']} collide; waves on rings as the analysis says on {summary['n_agree']} of "
        f"{summary['n_rings']}."
    )
    return Document(
        title="Is the simulated traffic traffic?",
        verdict=text,
        sections=tuple(sections),
        command="study stability",
        generated=generated,
        data=remarks.data,
        sources=remarks.sources,
        captions=CAPTIONS,
    )


def _verdicts(verdict: Sequence[Mapping[str, Any]], remarks: Remarks) -> Section:
    rows = pd.DataFrame(verdict)
    rows["statements"] = [" and ".join(statements) or None for statements in rows["statements"]]
    return Section("Verdicts", tables=(table_of("Verdicts", rows, VERDICT_COLUMNS),), notes=remarks.notes)


def _platoons(table: pd.DataFrame) -> Section:
    shown = table.assign(difference=table["difference"].abs())
    largest = shown.pivot_table(["analysis", "simulated", "difference"], ["model", "speed"], aggfunc="max", sort=False)
    columns = {"model": "", "speed": "speed [m/s]", "analysis": "analysis", "simulated": "simulated"}
    columns |= {"difference": "largest difference"}
    explanation = (
        "Largest amplification over the frequencies, typical drivers behind a first vehicle that oscillates.",
    )
    return Section("Platoons", explanation, (table_of("Amplification", largest.reset_index(), columns),))


def _rings(table: pd.DataFrame) -> Section:
    columns = {
        "model": "",
        "length": "ring [m]",
        "speed": "equilibrium [m/s]",
        "crests": "crests",
        "growth": "growth by analysis [1/s]",
        "simulated_growth": "simulated [1/s]",
        "slowest": "slowest at the end [m/s]",
        "fastest": "fastest [m/s]",
        "analysis": "waves by analysis",
        "simulation": "simulated",
        "agree": "agree",
    }
    explanation = (
        "Typical drivers from their equilibrium with a displacement of 1 cm; crests of the fastest-growing wave.",
    )
    return Section("Rings", explanation, (table_of("Waves on rings", table, columns),))


def _flow(flow: pd.DataFrame, queue: pd.DataFrame, traffic: pd.DataFrame) -> Section:
    best = flow.pivot_table("flow", "model", "start", aggfunc="max").reset_index()
    figures = queue.merge(best, on="model", how="left") if not flow.empty else queue
    columns = {
        "model": "",
        "even": "capacity from equal spacing [vehicles/h]",
        "jam": "from a jam [vehicles/h]",
        "outflow": "outflow of a queue [vehicles/h]",
        "wave_speed": "its wave [m/s]",
    }
    tables = [table_of("Flow of one lane", figures, columns)]
    collided = {"model": "", "traffic": "traffic", "collided": "collided", "vehicle_hours": "vehicle h"}
    tables.append(table_of("Collisions", traffic, collided | {"per_vehicle_hour": "per vehicle h"}))
    explanation = (
        "Drivers drawn from the population with their effects and noise; on one lane an overlap is a collision.",
    )
    return Section("Flow and collisions", explanation, tuple(tables))


def _measured(table: pd.DataFrame, margin: float) -> Section:
    bands = table["band_low"].map("{:g}".format) + " to " + table["band_high"].map("{:g} Hz".format)
    columns = {
        "name": "",
        "followers": "followers",
        "measured": "measured (95 %)",
        "simulated": "model",
        "ratio": "model over measured (90 %)",
        "equivalent": f"equivalent within {percent(margin)}",
    }
    explanation = (
        "Amplification between a leader's and its follower's speed, mean over followers; drawn drivers follow the same "
        "measured leaders. Equivalent: both one-sided t-tests at 5 %.",
    )
    shown = table_of("Measured followers", table.assign(name=table["model"] + ", " + bands), columns)
    return Section("Recordings", explanation, (shown,))

"""The joint verdict on groups of drivers: missing effects of each group, and differences between groups.

The verdict of a discovery by groups has the same keys as one without groups. `verdict` is the strongest of the groups'
verdicts, each effect names its group, and errors are those of all report drivers, each with the model of its group.
Candidates, unseen effects and adequacy are in the verdict of each group, `groups/<name>/verdict.json`. Additional keys:

groups    [{by, value, drivers, driver_seconds, cars, shared, labels, verdict, effects, error, car_following, base,
          equilibrium_time_gap, notes}]: `labels` {label: {value, share}} the most common value of each label and its
          share of the drivers, `cars` the number of persons or cars, null if no identity is known; `shared` the number
          of them among both fitted drivers (whom the model is fitted to) and report drivers (whose errors are
          stated); `equilibrium_time_gap` as in the entry `base` of a verdict without groups
grouping  {by, left_out: {value: drivers}}: number of drivers outside all groups; for kinds found without labels also
          {kinds, evidence, distinctness, gain, chance, uncertain, purity: {label: {value, by_chance}}}, see
          `discovery.groups.kinds`
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rearl_jax.config import DiscoverConfig
from rearl_jax.discovery.discover import Discovery
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.split import n_identified, n_shared
from rearl_jax.discovery.report.error_block import IDM, error_block
from rearl_jax.discovery.report.errors import ModelErrors
from rearl_jax.discovery.report.protocols import ProtocolErrors
from rearl_jax.discovery.report.tables import read_errors
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.discovery.thresholds import THRESHOLDS

STRONGEST_FIRST = ("named", "improved", "unexplained", "artefact", "nothing")
"""Verdicts, from the strongest statement to the weakest."""


def verdict_of_groups(
    options: DiscoverConfig, groups: Mapping[str, Discovery], parts: Mapping[str, Parts], left_out: Mapping[str, int]
) -> dict[str, Any]:
    """The verdict on all groups, without the computation time, from the verdict and the table of errors of each group
    and its drivers; `left_out` is the number of drivers outside all groups, by value of the label.
    """
    rows = [_row(options, name, discovery.verdict, parts[name]) for name, discovery in groups.items()]
    verdicts = [row["verdict"] for row in rows]
    errors = _joined([read_errors(one.tables["errors"], one.verdict["error"]) for one in groups.values()])
    data = [discovery.verdict["data"] for discovery in groups.values()]
    notes = list(dict.fromkeys(note for entry in data for note in entry["notes"]))
    return {
        "verdict": min(verdicts, key=STRONGEST_FIRST.index),
        "effects": [effect | {"group": row["value"]} for row in rows for effect in row["effects"]],
        "candidates": [],
        "lane_changes": [],
        "unseen": [],
        "error": error_block(errors, Resampling(options.confidence, options.draws, options.seed)),
        "adequacy": None,
        "failed_tests": [],
        "lane_choice": None,
        "base": None,
        "data": data[0]
        | {
            "car_following": ", ".join(dict.fromkeys(entry["car_following"] for entry in data)),
            "drivers": {part: sum(entry["drivers"][part] for entry in data) for part in data[0]["drivers"]},
            "driver_seconds": sum(entry["driver_seconds"] for entry in data),
            "notes": notes,
        },
        "thresholds": THRESHOLDS.plain(),
        "groups": rows,
        "grouping": {"by": options.by, "left_out": dict(left_out)},
    }


def _row(options: DiscoverConfig, name: str, verdict: Mapping[str, Any], parts: Parts) -> dict[str, Any]:
    all_drivers = parts.fitted.with_drivers(parts.checked).with_drivers(parts.reported)
    persons = n_identified(all_drivers)
    return {
        "by": options.by,
        "value": name,
        "drivers": verdict["data"]["drivers"],
        "driver_seconds": verdict["data"]["driver_seconds"],
        "cars": persons or None,
        "shared": n_shared(parts.fitted, parts.reported),
        "labels": _most_common(all_drivers),
        "verdict": verdict["verdict"],
        "effects": verdict["effects"],
        "failed_tests": verdict["failed_tests"],
        "error": verdict["error"],
        "car_following": verdict["data"]["car_following"],
        "base": verdict["base"],
        "equilibrium_time_gap": (verdict["base"] or verdict)["equilibrium_time_gap"],
        "notes": verdict["data"]["notes"],
    }


def _most_common(data: Measured) -> dict[str, Any]:
    """The most common value of each label and its share of the drivers; labels that no driver has are left out."""
    common = {}
    for name in data.labels:
        counts = Counter(value for value in data.label(name).tolist() if value is not None)
        for value, n in counts.most_common(1):
            common[name] = {"value": value, "share": n / data.n_drivers}
    return common


def _joined(groups: Sequence[Mapping[str, ModelErrors]]) -> dict[str, ModelErrors]:
    """Errors of the drivers of all groups, each with the model of its group. A model that a group lacks (`after` if no
    effect was added, or IDM) has the errors `before`.
    """
    joined = {}
    for model in ("before", "after", IDM):
        parts = [errors.get(model, errors["before"]) for errors in groups]
        by_driver = {name: np.concatenate([part.by_driver[name] for part in parts]) for name in parts[0].by_driver}
        floor = np.concatenate([part.floor for part in parts])
        protocols = {name: _joined_protocol([part.protocols[name] for part in parts]) for name in parts[0].protocols}
        joined[model] = ModelErrors(by_driver, floor, protocols, responses=None)
    return joined


def _joined_protocol(groups: Sequence[ProtocolErrors | None]) -> ProtocolErrors | None:
    """Errors of the drivers of all groups under one protocol; None if no driver could be tested."""
    tested = [errors for errors in groups if errors is not None]
    if not tested:
        return None

    def concatenated(name: str) -> dict[str, np.ndarray]:
        parts = [getattr(errors, name) for errors in tested]
        return {measure: np.concatenate([part[measure] for part in parts]) for measure in parts[0]}

    n_drivers = [len(errors.driver) for errors in tested]
    left_out = sum(errors.left_out for errors in tested)
    return ProtocolErrors(np.arange(sum(n_drivers)), concatenated("by_driver"), concatenated("population"), left_out)

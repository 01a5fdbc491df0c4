"""The verdict of a study of stability, in `verdict.json`: a list with one object per model.

`model`, `string_unstable` (waves grow along its simulated platoons), `largest_amplification` [-] of these platoons
(both null if it drives at none of their speeds), `collides` (any simulated vehicle did), `collisions_per_vehicle_hour`
[1/h]; `recording_string_unstable` (null if the interval of the measured amplification holds 1, or nothing was
measured), `recording_collides` (null if nothing was measured), and `statements`: those of `string_unstable` and
`collides` that are true of the model and false of the recording.
"""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.study.stability.measured import Pairs

TOLERANCE = 1e-3
"""Amplification above 1 from which a platoon counts as unstable [-], above the error of the simulation."""


def verdict_of(model: str, tables: Mapping[str, pd.DataFrame], pairs: Pairs) -> dict[str, Any]:
    """The object of one model, from the tables of all models and the measured followers, perhaps none."""
    amplification, traffic, measured = (
        tables[table].loc[tables[table]["model"] == model] for table in ("amplification", "traffic", "measured")
    )
    largest = max(amplification["simulated"].tolist(), default=None)
    collided, hours = (sum(traffic[column].tolist()) for column in ("collided", "vehicle_hours"))
    simulated = {
        "string_unstable": None if largest is None else largest > 1 + TOLERANCE,
        "largest_amplification": largest,
        "collides": collided > 0,
        "collisions_per_vehicle_hour": collided / hours,
    }
    recording = {
        "recording_string_unstable": _is_unstable(measured),
        "recording_collides": None if not pairs.hours else pairs.overlaps > 0,
    }
    statements = [
        name for name in ("string_unstable", "collides") if simulated[name] and recording[f"recording_{name}"] is False
    ]
    return {"model": model, **simulated, **recording, "statements": statements}


def _is_unstable(measured: pd.DataFrame) -> bool | None:
    """True if measured followers amplify their leaders' speeds in a band of frequencies; None if undecided."""
    if measured.empty:
        return None
    if max(measured["measured_low"].tolist()) > 1:
        return True
    return None if max(measured["measured_high"].tolist()) >= 1 else False

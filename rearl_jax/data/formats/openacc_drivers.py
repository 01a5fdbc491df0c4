"""Driver of a car in a run of OpenACC (see `openacc`) if it changes: adaptive cruise control or a person."""

from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.data.checks.losses import split_tracks
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_rows import follows_row_before

ACC = "acc"
"""Label of tracks: 1 with adaptive cruise control, 0 with people at the wheel; None if the file does not state it."""


def switched(table: pd.DataFrame, drivers: pd.Series, info: RecordingInfo) -> tuple[pd.DataFrame, RecordingInfo]:
    """The table, in which a car becomes a new track after every switch of its driver, and the recording with a note.

    Args:
        table: Rows of cars, sorted by track_id (the place in the platoon) and frame.
        drivers: Values of the label ACC by place and frame.
        info: The recording.
    """
    places = pd.MultiIndex.from_arrays([table["track_id"], table["frame"]])
    values = drivers.reindex(places).to_numpy(object)
    label = np.array([value if isinstance(value, str) else "" for value in values], dtype=object)
    # Rows that continue the track of the row before with another driver.
    switches = follows_row_before(table["track_id"].to_numpy())
    switches[1:] &= label[1:] != label[:-1]
    table = table.assign(**{ACC: [value or None for value in label]})
    if not switches.any():
        return table, info
    share = float(np.mean(label == "1"))
    note = f"{int(switches.sum())} switches between cruise control and person: a car continues as another track"
    note += f" ({100.0 * share:.0f} % of the rows with cruise control)"
    return split_tracks(table, switches), replace(info, notes=(*info.notes, note))

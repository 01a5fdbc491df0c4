"""Labels of OpenACC's runs (see `openacc`): whether cruise control drove, also where that changes, and its time gap."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import BadRows
from rearl_jax.data.checks.losses import split_tracks
from rearl_jax.data.files.delimited import read_csv
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_rows import follows_row_before

ACC = "acc"
"""Label of tracks: 1 with adaptive cruise control, 0 with people at the wheel; None if the file does not state it."""
INDEX_FILE = "zalazone_index.csv"
"""Name of the index in the folder of the platoons."""

_SETTINGS = ("S", "M", "L")


def labels_of_run(index: Path, run: str) -> dict[str, str | None]:
    """Labels of all vehicles of a run; empty if there is no index.

    `acc` is 1 with adaptive cruise control and 0 with people at the wheel. `setting` is the time gap that was set: S,
    M, L, or mixed where cars were set differently; None where people drove, or the run is not in the index.

    Raises:
        BadRecordingError: The index is damaged, lists the run twice, or contains an unknown label.
    """
    if not index.is_file():
        return {}
    lines, _ = read_csv(index, dict.fromkeys(("file", "acc", "setting"), pa.string()), BadRows.stop)
    rows = [row for row in lines.to_pylist() if (row["file"] or "").removesuffix(".csv") == run]
    if len(rows) > 1:
        text = f"the run {run} is listed twice"
        raise bad_recording("run-twice", text, "remove one of the rows", index, column="file")
    if not rows:
        return {"acc": None, "setting": None}
    # Lists in text, such as ['1'] and ['S'], or ['SL'] for a run with both settings.
    acc, settings = (re.findall(r"\w", rows[0][name] or "") for name in ("acc", "setting"))
    if acc not in (["0"], ["1"], []):
        raise _unusable(index, run, "acc", rows[0]["acc"], "0 or 1")
    if not set(settings) <= set(_SETTINGS):
        raise _unusable(index, run, "setting", rows[0]["setting"], f"some of {', '.join(_SETTINGS)}")
    setting = None if not settings else settings[0] if len(settings) == 1 else "mixed"
    return {"acc": acc[0] if acc else None, "setting": setting}


def _unusable(index: Path, run: str, column: str, value: str, wanted: str) -> Exception:
    text = f"{value} of the run {run} is not {wanted}"
    return bad_recording("label-unusable", text, f"write {wanted}", index, column=column)


def switched(table: pd.DataFrame, drivers: pd.Series, info: RecordingInfo) -> tuple[pd.DataFrame, RecordingInfo]:
    """The table, in which a car becomes a new track after every switch of its driver, and the recording with a note.

    The table is sorted by track_id (the place in the platoon) and frame; `drivers` holds the label ACC by both.
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

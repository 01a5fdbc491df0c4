"""Labels of tracks: columns in addition to the canonical ones (see `schema`), with one value per track.

Examples are the car model, the setting of the cruise control and the driver. Discovery, the search for effects
that a driver model is missing, groups vehicles by them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.data.problems import bad_recording
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.vehicle_rows import follows_row_before
from rearl_jax.problems import InvalidInputError, Problem

CANONICAL = ("recording", "vehicle_class", "direction", "lane")
"""Canonical columns that also serve as labels; the lane is the one in which the track was longest."""


def with_labels(info: RecordingInfo, wanted: Sequence[str], columns: Sequence[str]) -> RecordingInfo:
    """The metadata, to which wanted labels are added if they are columns of the source and not canonical."""
    known = [name for name in wanted if name in columns and name not in CANONICAL]
    return replace(info, labels=tuple(dict.fromkeys([*info.labels, *known])))


def labelled(table: pd.DataFrame, info: RecordingInfo) -> pd.DataFrame:
    """The table with its labels as texts.

    Raises:
        BadRecordingError: A label differs between the rows of a track.
    """
    for name in info.labels:
        codes, values = pd.factorize(table[name])
        texts = _texts(values)
        label = pd.Categorical([None if code < 0 else texts[code] for code in codes], sorted(set(texts)))
        order = np.argsort(table["track_id"].to_numpy(), kind="stable")
        in_order = label.codes[order]
        differs = follows_row_before(table["track_id"].to_numpy()[order])
        differs[1:] &= in_order[1:] != in_order[:-1]
        if differs.any():
            row = int(table.index[order[np.argmax(differs)]]) + 1
            text = f"the label {name} differs between rows of one vehicle"
            remedy = "give each vehicle one value, or give the parts of its track different ids"
            raise bad_recording("label-varies", text, remedy, info.file or info.id, column=name, row=row)
        table = table.assign(**{name: label})
    return table


def track_labels(recordings: Sequence[Recording], name: str, key: str) -> list[pd.Series]:
    """A label of the tracks of each recording, or one of CANONICAL, by track_id: texts, None where it is unknown.

    Raises:
        InvalidInputError: No recording has the label that the configuration key names.
    """
    if name in CANONICAL:
        return [_of_canonical(recording, name) for recording in recordings]
    found = dict.fromkeys(label for recording in recordings for label in recording.info.labels)
    if name not in found:
        known = ", ".join([*found, *CANONICAL])
        message = f"is {name}, which no recording has: choose one of {known}, or a further column of a canonical table"
        raise InvalidInputError(Problem("label-unknown", message, key=key))
    return [_of_label(recording, name) for recording in recordings]


def _of_label(recording: Recording, name: str) -> pd.Series:
    """A label of the tracks, by track_id; None where it is unknown or the recording lacks the label."""
    labels = recording.labels
    texts = list(labels[name]) if name in labels else [None] * len(labels)
    return pd.Series([text if isinstance(text, str) else None for text in texts], index=labels.index, dtype=object)


def _of_canonical(recording: Recording, name: str) -> pd.Series:
    """A canonical column as a label of the tracks, by track_id; of the lane, the one in most rows of the track."""
    table = recording.table
    tracks = table["track_id"].drop_duplicates()
    if name != "lane":
        return pd.Series([str(value) for value in table.loc[tracks.index, name]], index=tracks.to_numpy(), dtype=object)
    known = table.loc[table["lane"].notna(), ["track_id", "lane"]].astype(np.int64)
    rows = known.value_counts().reset_index().drop_duplicates("track_id")
    lanes = dict(zip(rows["track_id"], rows["lane"].astype(str), strict=True))
    return pd.Series([lanes.get(track) for track in tracks], index=tracks.to_numpy(), dtype=object)


def _texts(values: np.ndarray | pd.Index) -> list[str]:
    """Values as texts, the same for 4 and 4.0, because a text table does not distinguish them."""
    texts = [str(value) for value in values]
    numbers = pd.Series(pd.to_numeric(pd.Series(texts, dtype=object), errors="coerce"), dtype=np.float64)
    if not np.isfinite(numbers).all() or numbers.nunique() < len(texts):
        return texts
    return [str(int(number)) if number.is_integer() else text for number, text in zip(numbers, texts, strict=True)]

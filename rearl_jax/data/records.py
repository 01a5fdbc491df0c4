"""Records of one recording: its metadata and its table."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import pandas as pd

from rearl_jax.problems import out_of_range

SPEED_LIMITS = (11.0, 45.0)
"""Lowest and highest plausible speed limit [m/s]: 40 km/h on ramps are 11.1 m/s, 160 km/h are 44.4 m/s."""

_MAX_VALUE = 1e6
"""Larger than every length of a road [m] and every frame rate [1/s]."""


@dataclass(frozen=True)
class RecordingInfo:
    """Metadata of a recording.

    Attributes:
        id: Name of the recording, unique in its data set.
        frame_rate: Frames per second [1/s].
        lane_count: Number of lanes per direction (1, 2).
        road_length: Length of the observed road [m].
        source: Data set the recording belongs to.
        licence: Licence of the data.
        attribution: Name to be cited.
        generated: The recording was made by the generator, not measured.
        speed_limit: Legal speed limit [m/s]; None if there is none or it is unknown.
        lane_markings: Per direction the ascending lateral offsets of the lane markings from the left edge [m].
        labels: Columns of the table beyond the canonical ones: texts that group vehicles, one value per track.
        notes: Remarks for readers of results: assumed values, limits of the data set.
        file: File or folder the rows come from; for error messages, not exported.
        columns: Names of the columns in that file where they differ; for error messages, not exported.
    """

    id: str
    frame_rate: float
    lane_count: Mapping[int, int]
    road_length: float
    source: str
    licence: str
    attribution: str
    generated: bool = False
    speed_limit: float | None = None
    lane_markings: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    file: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The record as JSON values, without the fields that describe the local file."""
        record = asdict(self)
        del record["file"], record["columns"]
        return record

    @classmethod
    def from_json(cls, record: Mapping[str, Any], file: str = "") -> "RecordingInfo":
        """The record that `to_json` wrote; JSON keys of directions become integers again.

        Raises:
            KeyError, TypeError, ValueError: It is not such a record, or a value is impossible.
        """
        values = dict(record)
        values["lane_count"] = {int(k): int(v) for k, v in values["lane_count"].items()}
        values["lane_markings"] = {int(k): tuple(v) for k, v in values.get("lane_markings", {}).items()}
        for name in ("labels", "notes"):
            values[name] = tuple(values.get(name, ()))
        info = cls(**values, file=file)
        info.check()
        return info

    def check(self) -> None:
        """Raise InvalidInputError for a value that no recording can have."""
        for name in ("id", "source", "licence", "attribution"):
            if not (isinstance(value := getattr(self, name), str) and value):
                raise out_of_range(name, "must be a text", repr(value))
        for name in ("frame_rate", "road_length", "speed_limit"):
            value = getattr(self, name)
            if not (_is_number(value) and 0 < value < _MAX_VALUE) and not (name == "speed_limit" and value is None):
                raise out_of_range(name, "must be a number above 0", repr(value))
        if self.speed_limit is not None and not SPEED_LIMITS[0] <= self.speed_limit <= SPEED_LIMITS[1]:
            message = "must be a limit of a highway in m/s: is it in another unit?"
            raise out_of_range("speed_limit", message, self.speed_limit)
        if not self.lane_count or not all(side in (1, 2) and 0 < n < 100 for side, n in self.lane_count.items()):
            raise out_of_range("lane_count", "must be the number of lanes of the directions 1 and 2", self.lane_count)
        for offsets in self.lane_markings.values():
            if not all(_is_number(offset) and abs(offset) < _MAX_VALUE for offset in offsets):
                raise out_of_range("lane_markings", "must be numbers", offsets)
        if not all(isinstance(label, str) and label for label in self.labels):
            raise out_of_range("labels", "must be names of columns", self.labels)
        if not isinstance(self.generated, bool) or not all(isinstance(note, str) for note in self.notes):
            message = "must be true or false, and notes texts"
            raise out_of_range("generated", message, self.generated)


@dataclass(frozen=True)
class Recording:
    """One recording in the canonical schema.

    Attributes:
        info: Metadata.
        table: Canonical trajectory table, columns as in `schema.COLUMNS` and the labels, sorted by track_id and frame.
        dropped: Numbers of dropped items by cause: `<cause>` rows removed, `<cause>_cuts` cuts of a track in two,
            `tracks` tracks removed as a whole. Empty if nothing was dropped.
    """

    info: RecordingInfo
    table: pd.DataFrame
    dropped: Mapping[str, int] = field(default_factory=dict)

    @property
    def labels(self) -> pd.DataFrame:
        """Labels of each track, a column for each; the index is the track_id."""
        first = self.table.drop_duplicates("track_id").set_index("track_id")
        return first.reindex(columns=list(self.info.labels))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)

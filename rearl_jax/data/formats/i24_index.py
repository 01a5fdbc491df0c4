"""Index of a file of I-24 MOTION: the documents with vehicles in each time window and road section.

One pass over the file builds the index, with which a recording of hours is read part by part.
"""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.frame_rates import frame_rate_of, phase_of
from rearl_jax.data.files.json_documents import documents, parsed, unreadable_field
from rearl_jax.data.problems import DROP_HINT, bad_recording
from rearl_jax.data.units import SI_FACTOR

FEET = SI_FACTOR["ft"]
MILES = (57.0, 65.0)
"""Mile markers between which I-24 MOTION lies; x_position / 5280 ft is the mile marker."""
LANE = 12.0
"""Width of a lane, and of the shoulder beside the median [ft]."""
_FEET_PER_MILE = 5280.0
_MAX_NUMBER = 2e18  # larger than every position and every time, also in nanoseconds
_MIN_DOCUMENTS = 8  # documents needed to check the unit of y_position
_SINCE, _UNTIL = 1.5e9, 4.0e9  # s since 1970: the years 2017 and 2096
_BACKWARD = 5.0 / FEET  # ft that a vehicle may end upstream of its start, because of tracking errors
_LIST = pa.list_(pa.float64())
FIELDS: dict[str, pa.DataType] = {
    "timestamp": _LIST,
    "x_position": _LIST,
    "y_position": _LIST,
    "direction": pa.float64(),
    "length": pa.float64(),
}
"""Fields that every trajectory has, with their types."""
OPTIONAL: dict[str, pa.DataType] = {"width": pa.float64(), "coarse_vehicle_class": pa.float64()}
"""Further fields that are read, with their types."""

Cell = tuple[int, int]
"""Number of a window since 1970, and of a section since the mile marker 0."""


@dataclass
class Index:
    """Documents of a file.

    Attributes:
        path: The file.
        on_bad: stop makes a broken document an error.
        starts: Byte offset of each document in the file.
        sizes: Length of each document [bytes].
        cells: Numbers of the documents with a row in each window and section, from 0.
        frame_rate: Frames per second [1/s].
        phase: Offset of the frames of most documents from multiples of the frame interval [frames].
        dropped: Documents that were left out, by cause.
    """

    path: Path
    on_bad: BadRows
    starts: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    cells: dict[Cell, list[int]] = field(default_factory=dict)
    frame_rate: float = 0.0
    phase: float = 0.0
    dropped: Counter[str] = field(default_factory=Counter)

    def leave_out(self, cause: str, number: int, document: int, text: str, column: str | None = None) -> None:
        """Counts documents that are left out; `document` is the place of the first of them in the file, from 0.

        The cause, with hyphens for underscores, is also the code of the problem.

        Raises:
            BadRecordingError: on_bad is stop.
        """
        if self.on_bad is BadRows.stop:
            text = text if number == 1 else f"{text} (and {number - 1} more documents)"
            advice = "the file is damaged: copy it again" if column is None else "correct it, or copy the file again"
            remedy = f"{advice}{DROP_HINT}"
            code = cause.replace("_", "-")
            raise bad_recording(code, text, remedy, self.path, column=column, row=document + 1)
        self.dropped[cause] += number


def index_of(path: Path, policy: DataConfig) -> Index:
    """The index of a file, built again only if the file or `window`, `section` or `on_bad` has changed.

    Raises:
        BadRecordingError: The file holds no documents of I-24 MOTION, a unit is wrong, or a document is broken and
            on_bad is stop.
    """
    stat = path.stat()
    return _index(path, policy.window, policy.section, policy.on_bad, (stat.st_size, stat.st_mtime_ns))


@lru_cache(maxsize=2)
def _index(path: Path, window: float | None, section: float | None, on_bad: BadRows, stamp: tuple[int, int]) -> Index:
    index, known_ids = Index(path, on_bad), set[str]()
    steps, begins, miles = [], [], []
    offsets_from_middle: dict[float, list[np.ndarray]] = {-1.0: [], 1.0: []}  # by direction
    backward = Counter[tuple[float, bool]]()  # vehicles by direction, and by whether they moved against it
    for block in documents(path):
        first = len(index.starts)
        index.starts += block.starts
        index.sizes += block.sizes
        if block.n_broken:
            index.leave_out("broken_document", block.n_broken, len(index.starts), "the file is cut off")
        if not block.texts:
            continue
        fields = {"_id": _type_of_ids(block.texts[0]), **FIELDS, **OPTIONAL}
        table, broken = parsed(block.texts, fields)
        if broken.any():
            place = int(np.argmax(broken))
            name = unreadable_field(block.texts[place], fields)
            text = "the document is not JSON" if name is None else f"the field is not {_words(fields[name])}"
            index.leave_out("broken_document", int(broken.sum()), first + place, text, name)
        numbers = first + np.flatnonzero(~broken)
        _require_fields(table, path)
        table, numbers = _sound(index, table, numbers, known_ids)
        if not len(numbers):
            continue
        tracks = Tracks(table)
        times, x = tracks.time, tracks.values("x_position")
        direction = tracks.of_document("direction")
        steps.append(np.diff(times)[tracks.follows[1:]])
        begins.append(times[tracks.begins])
        for side, of_side in offsets_from_middle.items():
            of_side.append(np.abs(tracks.values("y_position")[tracks.begins])[direction == side])
        miles.append(x[tracks.begins] / _FEET_PER_MILE)
        moved = (x[tracks.ends] - x[tracks.begins]) * direction
        for side in (-1.0, 1.0):
            here = direction == side
            backward[side, True] += int((here & (moved < -_BACKWARD)).sum())
            backward[side, False] += int((here & (moved > _BACKWARD)).sum())
        wrong = moved < -_BACKWARD
        if wrong.any():
            _require_forward(backward, path)
            text = "x_position does not go the way of direction (1 = rising, -1 = falling)"
            document = int(numbers[np.argmax(wrong)])
            index.leave_out("wrong_direction", int(wrong.sum()), document, text, "direction")
        centre = FEET * (x + 0.5 * np.repeat(direction * tracks.of_document("length"), tracks.counts))
        keys = np.stack([_cell(times, window), _cell(centre, section)], axis=1)
        _add_to_index(index, keys, np.repeat(numbers, tracks.counts), np.repeat(~wrong, tracks.counts))
    _require_forward(backward, path)
    if not begins:
        return index
    _require_units(np.concatenate(begins), np.concatenate(miles), path)
    for side, of_side in offsets_from_middle.items():
        _require_feet_across(np.concatenate(of_side), side, path)
    index.frame_rate = frame_rate_of(np.concatenate(steps), path, "timestamp")
    index.phase = phase_of(np.concatenate(begins) * index.frame_rate)
    return index


class Tracks:
    """Arrays of parsed documents, one behind the other."""

    def __init__(self, table: pa.Table) -> None:
        self._table = table.combine_chunks()
        self.counts = np.asarray(self._table["timestamp"].combine_chunks().value_lengths())
        """Rows of each document."""
        self.ends = np.cumsum(self.counts) - 1
        self.begins = self.ends - self.counts + 1
        self.follows = np.ones(int(self.counts.sum()), dtype=bool)
        """Mask of the rows that are not the first of their document."""
        self.follows[self.begins] = False
        self.time = self.values("timestamp")

    def values(self, name: str) -> np.ndarray:
        """Values of an array field, of all documents one after the other."""
        return self._table[name].combine_chunks().flatten().to_numpy(zero_copy_only=False).astype(np.float64)

    def of_document(self, name: str) -> np.ndarray:
        """Value of a number field of each document."""
        return self._table[name].to_numpy().astype(np.float64)


def _type_of_ids(document: bytes) -> pa.DataType:
    """Type of the ids of documents: an object with one text, or in copies the text itself."""
    is_text = re.search(rb'"_id"\s*:\s*"', document) is not None
    return pa.string() if is_text else pa.struct({"$oid": pa.string()})


def _words(kind: pa.DataType) -> str:
    """What a field of a type holds, in words."""
    if pa.types.is_list(kind):
        return "an array of numbers"
    return "a number" if pa.types.is_floating(kind) else "an id as MongoDB writes it"


def _cell(values: np.ndarray, length: float | None) -> np.ndarray:
    """Number of the window or section of this length that holds each value; 0 if there is only one."""
    if length is None:
        return np.zeros(len(values), np.int64)
    return np.floor(np.clip(values / length, -_MAX_NUMBER, _MAX_NUMBER)).astype(np.int64)


def _add_to_index(index: Index, keys: np.ndarray, number: np.ndarray, sound: np.ndarray) -> None:
    """Adds the documents of sound rows to the index; each row has its cell in `keys` and its document in `number`."""
    new = np.ones(len(keys), dtype=bool)
    new[1:] = (keys[1:] != keys[:-1]).any(axis=1) | (number[1:] != number[:-1])
    rows = np.flatnonzero(new & sound)
    for window, section, document in zip(
        keys[rows, 0].tolist(), keys[rows, 1].tolist(), number[rows].tolist(), strict=True
    ):
        of_cell = index.cells.setdefault((window, section), [])
        if not of_cell or of_cell[-1] != document:
            of_cell.append(document)


def _sound(index: Index, table: pa.Table, numbers: np.ndarray, known_ids: set[str]) -> tuple[pa.Table, np.ndarray]:
    """The documents of a block that can be placed in time and on the road, and their numbers in the file.

    Losses are counted in the index; `known_ids`, those of the documents read so far, get those of the block.
    """

    def missing(name: str) -> np.ndarray:
        return table[name].is_null().to_numpy()

    def lengths(name: str) -> np.ndarray:
        return np.asarray(table[name].combine_chunks().value_lengths().fill_null(0))

    def unknown(name: str) -> np.ndarray:
        values = table[name].combine_chunks().flatten().to_numpy(zero_copy_only=False).astype(np.float64)
        sums = np.concatenate([[0], np.cumsum(~(np.abs(values) <= _MAX_NUMBER))])
        ends = np.cumsum(lengths(name))
        return sums[ends] > sums[ends - lengths(name)]

    def twice(name: str) -> np.ndarray:
        found = np.zeros(table.num_rows, dtype=bool)
        ids = table[name].combine_chunks()
        ids = ids.field("$oid") if pa.types.is_struct(ids.type) else ids
        for number, text in enumerate(ids.to_pylist()):
            found[number] = text is not None and text in known_ids
            known_ids.add(text or "")
        return found

    def other_length(name: str) -> np.ndarray:
        return lengths(name) != lengths("timestamp")

    def impossible(name: str) -> np.ndarray:
        return ~(np.abs(table[name].to_numpy()) <= _MAX_NUMBER)

    def no_direction(name: str) -> np.ndarray:
        return ~np.isin(table[name].to_numpy(), (1.0, -1.0))

    # One after the other, because each needs documents that have passed those before.
    checks: tuple[tuple[str, Sequence[str], Callable[[str], np.ndarray], str], ...] = (
        ("value_missing", tuple(FIELDS), missing, "the value is missing"),
        ("no_rows", ("timestamp",), lambda name: lengths(name) == 0, "the array is empty"),
        ("lengths_differ", ("x_position", "y_position"), other_length, "the array has another length than timestamp"),
        ("not_finite", ("timestamp", "x_position"), unknown, "a value of the array is missing or impossible"),
        ("not_finite", ("length",), impossible, "the value is impossible"),
        ("wrong_direction", ("direction",), no_direction, "the direction is neither 1 nor -1"),
        ("duplicate", ("_id",), twice, "the document occurs twice"),
    )
    for cause, names, find_bad, text in checks:
        for name in names:
            bad = find_bad(name)
            if bad.any():
                index.leave_out(cause, int(bad.sum()), int(numbers[np.argmax(bad)]), text, name)
                table, numbers = table.filter(pa.array(~bad)), numbers[~bad]
    return table, numbers


def _require_fields(table: pa.Table, path: Path) -> None:
    lacking = [name for name in FIELDS if table.num_rows and table[name].null_count == table.num_rows]
    if len(lacking) == len(FIELDS):
        text = f"{path.name} does not hold trajectories of I-24 MOTION"
        raise bad_recording("not-a-table", text, "move it out of the folder", path)
    if lacking:
        text, remedy = "no document of the block has the field", "give trajectories of I-24 MOTION INCEPTION"
        raise bad_recording("column-missing", text, remedy, path, column=lacking[0])


def _require_forward(backward: Counter[tuple[float, bool]], path: Path) -> None:
    """Raise BadRecordingError if most vehicles of a carriageway drive against its direction."""
    for side in (-1.0, 1.0):
        if backward[side, True] > backward[side, False]:
            text = f"most documents of direction {side:g} have an x_position that {'falls' if side > 0 else 'rises'}"
            remedy = "direction 1 is eastbound and rises, -1 is westbound and falls: correct one of them"
            raise bad_recording("wrong-direction", text, remedy, path, column="x_position")


def _require_units(times: np.ndarray, miles: np.ndarray, path: Path) -> None:
    """Raise BadRecordingError for times or mile markers in another unit."""
    mile, time = float(np.median(miles)), float(np.median(times))
    if not MILES[0] <= mile <= MILES[1]:
        text = (
            f"x_position / 5280 is {mile:.4g}, but the road lies between the mile markers {MILES[0]:g} and {MILES[1]:g}"
        )
        raise bad_recording("wrong-units", text, "give x_position in feet from mile 0", path, column="x_position")
    if not _SINCE <= time <= _UNTIL:
        text = f"the times are about {time:.6g}"
        raise bad_recording("wrong-units", text, "give the times in s since 1970", path, column="timestamp")


def _require_feet_across(offsets_from_middle: np.ndarray, side: float, path: Path) -> None:
    """Raise BadRecordingError if the distances of a carriageway's vehicles from the middle of the road are not in ft.

    Each carriageway is checked by itself, because both together hide a fault of one.
    """
    offsets_from_middle = offsets_from_middle[np.isfinite(offsets_from_middle)]
    # Most vehicles drive right of the left shoulder, some right of the second lane, none beyond the sixth.
    far = float(np.quantile(offsets_from_middle, 0.95)) if offsets_from_middle.size else 0.0
    if offsets_from_middle.size >= _MIN_DOCUMENTS and (
        np.median(offsets_from_middle) < LANE or not 2.0 * LANE <= far <= 7.5 * LANE
    ):
        text = f"direction {side:g}: the outermost vehicles are {far:.3g} ft beside the middle of the road"
        raise bad_recording("wrong-units", text, "give y_position in feet", path, column="y_position")

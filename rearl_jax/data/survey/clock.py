"""Search for the columns of an unknown table that identify the vehicles and the times or frames of its rows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.data.survey.sample import FoundColumn
from rearl_jax.data.tables.usual_names import ALIASES, rank_of

_MIN_RISING_SHARE = 0.98  # of the steps along tracks must be positive for a column to be a clock
_MIN_USUAL_SHARE = 0.8  # of the steps must be near the median step
_MIN_TRACK_ROWS = 3  # rows of a track, on average
_DAY = r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|20\d{6}"
_DAY_SECONDS = 86_400.0


@dataclass(frozen=True)
class Clock:
    """Columns that identify the vehicles and the times.

    Attributes:
        track: Column of the vehicles.
        time: Column of times; None for none.
        frame: Column of frames; None for none.
        recording: Column of the recordings; None for none.
        by_name: True if the columns were found by name, not by values alone.
    """

    track: FoundColumn
    time: FoundColumn | None
    frame: FoundColumn | None
    recording: FoundColumn | None
    by_name: bool

    @property
    def time_or_frame(self) -> FoundColumn:
        """The column by which the rows of a track are ordered: the times if there are times, else the frames."""
        found = self.time or self.frame
        assert found is not None
        return found

    @property
    def vehicles(self) -> np.ndarray:
        """A number for each vehicle of each recording."""
        return vehicles_of(self.track, self.recording)

    @property
    def step(self) -> float:
        """Usual step of the times or frames along a track."""
        steps = _steps(self.vehicles, self.time_or_frame.values)
        return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0


def clock_of(columns: Sequence[FoundColumn]) -> Clock | None:
    """The columns of vehicles and times; None if no two columns fit."""
    recordings: list[FoundColumn | None] = [
        column for column in named(columns, "recording") if 1 < len(np.unique(column.codes)) <= len(column.codes) / 3
    ]
    days = [column for column in columns if is_days(column) and len(np.unique(column.codes)) > 1]
    # First without any step back in time, then with a few, which damaged rows cause. If ids restart in each recording,
    # times step back unless the recordings are distinguished.
    for share in (1.0, _MIN_RISING_SHARE):
        for recording in (None, *recordings):
            for track in named(columns, "track_id"):
                found = _by_name(columns, track, recording, share)
                if found is not None:
                    return _of_days(found, days)
    by_values = _by_values(columns)
    return None if by_values is None else _of_days(by_values, days)


def is_days(column: FoundColumn) -> bool:
    """True if the values are dates without a time of day."""
    return bool(column.texts.dropna().astype(str).str.fullmatch(_DAY).all()) and column.kind != "empty"


def _of_days(clock: Clock, days: Sequence[FoundColumn]) -> Clock:
    """The clock, with a recording for each day if its times are times of day and another column holds the date."""
    if not days or clock.recording is not None or clock.time is None or clock.time.kind != "moments":
        return clock
    is_of_day = float(np.nanmax(np.abs(clock.time.values))) <= _DAY_SECONDS
    return replace(clock, recording=days[0]) if is_of_day else clock


def _by_name(
    columns: Sequence[FoundColumn], track: FoundColumn, recording: FoundColumn | None, share: float
) -> Clock | None:
    """The clock along the tracks of a column, if one rises in at least a share of the steps."""
    vehicles = vehicles_of(track, recording)
    if track.kind == "empty" or len(vehicles) < _MIN_TRACK_ROWS * len(np.unique(vehicles)):
        return None
    rising = [column for column in columns if column is not track and is_rising(vehicles, column, share)]
    times, frames = named(rising, "time"), [column for column in named(rising, "frame") if column.is_whole]
    times = times or [column for column in rising if column.kind == "moments"]
    if not times and not frames:
        return None
    return Clock(track, next(iter(times), None), next(iter(frames), None), recording, by_name=True)


def named(columns: Sequence[FoundColumn], canonical: str) -> list[FoundColumn]:
    """The columns that have a name of a canonical column, the most specific name first."""
    ranks = [(rank, place) for place, c in enumerate(columns) if (rank := rank_of(c.name, canonical)) is not None]
    return [columns[place] for _, place in sorted(ranks)]


def vehicles_of(track: FoundColumn, recording: FoundColumn | None) -> np.ndarray:
    """A number for each vehicle of each recording."""
    codes = track.codes
    return codes if recording is None else codes + (codes.max(initial=0) + 2) * (recording.codes + 1)


def is_rising(vehicles: np.ndarray, column: FoundColumn, share: float = _MIN_RISING_SHARE) -> bool:
    """True if the values rise along tracks, row after row, by about the same step."""
    if column.kind not in ("numbers", "moments"):
        return False
    steps = _steps(vehicles, column.values)
    if not steps.size or np.mean(steps > 0.0) < share:
        return False
    usual = float(np.median(steps))
    return bool(np.mean(np.abs(steps - usual) <= 0.5 * usual) >= _MIN_USUAL_SHARE)


def _steps(vehicles: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Changes of a column from each row of a vehicle to its next one, where both values are known."""
    known = np.isfinite(values) & (vehicles >= 0)
    order = np.argsort(vehicles[known], kind="stable")
    track, values = vehicles[known][order], values[known][order]
    return np.diff(values)[np.diff(track) == 0]


def _by_values(columns: Sequence[FoundColumn]) -> Clock | None:
    """The vehicles and times of a table without known column names: the fewest tracks along which a column rises."""
    for share in (1.0, _MIN_RISING_SHARE):
        found = _fewest_tracks(columns, share)
        if found is not None:
            track, clock = found
            is_frame = clock.is_whole and np.median(_steps(track.codes, clock.values)) == 1.0
            return Clock(track, None if is_frame else clock, clock if is_frame else None, None, by_name=False)
    return None


def _fewest_tracks(columns: Sequence[FoundColumn], share: float) -> tuple[FoundColumn, FoundColumn] | None:
    """The column with the fewest tracks along which another one rises in at least a share of the steps, and both."""
    best: tuple[int, FoundColumn, FoundColumn] | None = None
    for track in columns:
        n_tracks = len(np.unique(track.codes))
        is_id = (track.kind == "words" or track.is_whole) and not _is_named_otherwise(track, ("track_id",))
        if not is_id or n_tracks < 2 or n_tracks * _MIN_TRACK_ROWS > len(track.codes):
            continue
        others = [c for c in columns if c is not track and not _is_named_otherwise(c, ("time", "frame"))]
        rising = [column for column in others if is_rising(track.codes, column, share)]
        rising = named(rising, "time") or rising
        if rising and (best is None or n_tracks < best[0]):
            best = (n_tracks, track, rising[0])
    return None if best is None else best[1:]


def _is_named_otherwise(column: FoundColumn, canonical: Sequence[str]) -> bool:
    """True if a column has a name of other canonical columns, and none of these."""
    ranks = {name for name in ALIASES if rank_of(column.name, name) is not None}
    return bool(ranks) and not ranks & set(canonical)

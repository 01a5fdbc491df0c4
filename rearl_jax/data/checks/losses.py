"""Removal of bad rows as `data.on_bad` requires, with counts, and the division of tracks at removed rows."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.problems import Finding, bad_recording
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_rows import first_and_last_rows


@dataclass
class Losses:
    """Rows and tracks left out while one recording is read.

    Attributes:
        counts: Rows by cause, cuts by cause under `<cause>_cuts`, vehicles left without any row under
            `tracks`; becomes `Recording.dropped`.
        cut: Ids of the parts of tracks that were cut because of a fault.
    """

    counts: Counter[str] = field(default_factory=Counter)
    cut: set[int] = field(default_factory=set)

    def count(self, cause: str, number: int) -> None:
        """Counts rows left out for a cause, if there are any."""
        if number:
            self.counts[cause] += number

    def remove(self, table: pd.DataFrame, rows: np.ndarray, cause: str) -> pd.DataFrame:
        """The table without the marked rows, which are counted under the cause."""
        track = table["track_id"].to_numpy()
        self.count(cause, int(rows.sum()))
        known = track == track  # an unknown id (NaN) is not a track
        self.count("tracks", np.unique(track[known]).size - np.unique(track[known & ~rows]).size)
        return table.iloc[np.flatnonzero(~rows)]


def stop_or_count(
    table: pd.DataFrame, finding: Finding, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> None:
    """Counts the marked rows of a finding, which the caller treats itself.

    Raises:
        BadRecordingError: There are any, and data.on_bad is stop.
    """
    n_rows = int(finding.rows.sum())
    if n_rows and policy.on_bad is BadRows.stop:
        raise finding.error(table, info)
    losses.count(finding.name, n_rows)


def reject(
    table: pd.DataFrame, finding: Finding | None, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> pd.DataFrame:
    """The table without what the finding marks, if it marks any rows; the loss is counted in `losses`.

    The index of the table holds the row numbers of the source, from 0.

    Raises:
        BadRecordingError: Rows are marked and data.on_bad is stop, or nothing is left.
    """
    if finding is None or not finding.rows.any():
        return table
    if policy.on_bad is BadRows.stop:
        raise finding.error(table, info)
    track = table["track_id"].to_numpy()
    if policy.on_bad is BadRows.drop_row and finding.is_step:
        losses.count(f"{finding.name}_cuts", int(finding.rows.sum()))
        losses.cut.update(track[finding.rows].tolist())
        table = split_tracks(table, finding.rows)
        parts = table["track_id"].to_numpy()
        losses.cut.update(np.unique(parts[parts > track.max()]).tolist())
        return table
    rows = finding.rows
    if policy.on_bad is BadRows.drop_track:
        # The marked rows themselves too, because an unknown track id (NaN) is not equal to itself.
        rows = rows | np.isin(track, track[rows])
    table = losses.remove(table, rows, finding.name)
    if table.empty:
        text = f"no row is left after dropping, the last cause was {finding.name}: {finding.message}"
        raise bad_recording("no-row-left", text, finding.remedy, info.file or info.id, column=finding.column)
    return table


def remove_fragments(table: pd.DataFrame, info: RecordingInfo, losses: Losses) -> pd.DataFrame:
    """The table without those parts of divided tracks that are shorter than 1 s.

    Raises:
        BadRecordingError: Nothing is left.
    """
    if not losses.cut:
        return table
    track = table["track_id"].to_numpy()
    _, which, n_rows = np.unique(track, return_inverse=True, return_counts=True)
    short = np.isin(track, list(losses.cut)) & (n_rows[which] < info.frame_rate)
    if short.all():
        text = "no row is left: all pieces of tracks that were cut are shorter than 1 s"
        raise bad_recording("no-row-left", text, "correct the faults at which they were cut", info.file or info.id)
    return losses.remove(table, short, "fragment") if short.any() else table


def split_tracks(table: pd.DataFrame, starts: np.ndarray) -> pd.DataFrame:
    """The table in which a track ends before each marked row and continues under a new id.

    New ids follow the largest one. `leader_id` follows the vehicle to its new id frame by frame, and becomes unknown if
    the leader has no row. The table is sorted by (track_id, frame), and so is the result.
    """
    if table.empty:
        return table
    old = table["track_id"].to_numpy()
    n_cuts = np.cumsum(starts)
    first, last = first_and_last_rows(old)
    n_cuts_of_track = n_cuts - np.repeat(n_cuts[first] - starts[first], last - first + 1)
    is_renamed = n_cuts_of_track > 0
    new = np.where(is_renamed, np.nanmax(old) + n_cuts, old)  # the schema check finds unknown ids (NaN)
    table = table.assign(track_id=new)
    if "leader_id" in table:
        table["leader_id"] = _followed_leader(table, old, new, np.unique(old[is_renamed]))
    return table.iloc[np.argsort(new, kind="stable")]


def _followed_leader(table: pd.DataFrame, old: np.ndarray, new: np.ndarray, split: np.ndarray) -> pd.Series:
    """`leader_id` of each row, in which the ids of split tracks are replaced by their new ones at the row's frame.

    `old` and `new` are the track_id of each row before and after, `split` the former ids of the split tracks.
    """
    # Through float64: ids are far below 2^53, and NaN stands for unknown.
    leader = table["leader_id"].to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
    rows = np.isin(leader, split)
    frame = table["frame"].to_numpy()
    parts = np.isin(old, split)
    new_id = pd.Series(new[parts], index=pd.MultiIndex.from_arrays([old[parts], frame[parts]]))
    wanted = pd.MultiIndex.from_arrays([leader[rows].astype(np.int64), frame[rows]])
    leader[rows] = new_id.reindex(wanted).to_numpy()
    return pd.Series(pd.array(leader, dtype="Int64"), index=table.index)

"""Trial of a proposal: reads the table, and leaves out refused columns one by one until the rest can be read."""

from dataclasses import dataclass, field, replace

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.checks.column_checks import ALONE
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.survey.proposal import Proposal
from rearl_jax.data.tables.spelling import OPTIONAL
from rearl_jax.problems import ProblemError

_OF_COLUMNS = ("wrong-units", "wrong-origin")
"""Codes of faults of whole columns; other faults may concern a few rows only."""
_IN_LENGTHS = ("length", "width", "lateral")
"""Columns that distinguish positions in m from positions in ft, which speeds in m/s or ft/s do not."""
_MAX_DROPPED_SHARE = 0.05
"""Share of the rows that may be dropped before a column is left out instead."""
_MAX_LOST_SHARE = 0.15
"""Share of the rows that may be dropped in any case; a table that loses more cannot be read."""
_CAUSED_BY = {"y": "lateral"}
"""Columns that are filled in from others."""


@dataclass
class Trial:
    """Result of reading a table on trial with a configuration; without an error it can be read.

    Its recordings have the keys id, rows, vehicles and frame_rate; rows and tracks are dropped by cause.
    """

    data: DataConfig
    recordings: list[dict] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    dropped: dict[str, int] = field(default_factory=dict)
    error: ProblemError | None = None

    @property
    def share_dropped(self) -> float:
        """Rows that were dropped, as a share of all."""
        n_dropped = sum(n for cause, n in self.dropped.items() if cause != "tracks" and not cause.endswith("_cuts"))
        return n_dropped / max(n_dropped + sum(recording["rows"] for recording in self.recordings), 1)


def tried(root: str, proposal: Proposal, present: list[str]) -> Trial:
    """The table as it can be read, a file, or a folder of files that all have the columns `present`.

    Columns that the reader refuses are moved to `proposal.refused`.
    """
    while True:
        keys = {"columns": proposal.columns(present), "units": proposal.units, "ring": proposal.ring}
        data = DataConfig(DataFormat.table, root, **keys)
        # The survey itself says why it leaves out a column, so the reader need not say that it may be meant.
        without = dict.fromkeys(name for name in OPTIONAL if name not in proposal.taken)
        strict = _read(data, without)
        if strict.error is None:
            return strict
        column = _optional_at_fault(strict.error, proposal)
        if column in _IN_LENGTHS and strict.error.problem.fault.startswith(ALONE):
            return strict  # without the column, two units would be read as one
        if column is not None and strict.error.code in _OF_COLUMNS:
            proposal.leave_out(column, strict.error.problem.fault)
            continue
        lenient = _read(replace(data, on_bad=BadRows.drop_row), without)
        most = _MAX_LOST_SHARE if column is None else _MAX_DROPPED_SHARE
        if lenient.error is None and lenient.share_dropped <= most:
            lenient.notes.append(f"data.on_bad=stop stops at: {strict.error.problem.message}")
            return lenient
        if column is None:
            return strict
        proposal.leave_out(column, strict.error.problem.fault)


def _read(data: DataConfig, without: dict[str, None]) -> Trial:
    """The table as `data` reads it, without the canonical columns of `without`."""
    trial = Trial(data)
    try:
        for recording in iterate_recordings(replace(data, columns=data.columns | without)):
            info, table = recording.info, recording.table
            counts = {"rows": len(table), "vehicles": len(table["track_id"].unique()), "frame_rate": info.frame_rate}
            trial.recordings.append({"id": info.id, **counts})
            trial.notes.extend(note for note in info.notes if note not in trial.notes)
            for cause, number in recording.dropped.items():
                trial.dropped[cause] = trial.dropped.get(cause, 0) + number
    except ProblemError as error:
        trial.error = error
    return trial


def _optional_at_fault(error: ProblemError, proposal: Proposal) -> str | None:
    """The canonical column at fault, if a table can be read without it."""
    names = {taken.source: name for name, taken in proposal.taken.items()}
    column = error.problem.column
    name = names.get(column or "", _CAUSED_BY.get(column or ""))
    return name if name in OPTIONAL and name in proposal.taken else None

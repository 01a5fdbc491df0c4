"""`rearl prepare FILE`: describes an unknown file or folder, and prints the command that reads it."""

from importlib import import_module
from pathlib import Path
from typing import Any

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.readers import reader_of
from rearl_jax.data.survey.proposal import proposal_of
from rearl_jax.data.survey.report import command_of, print_format, print_sample, print_trial
from rearl_jax.data.survey.sample import sample_of
from rearl_jax.data.survey.sides import judge_sides
from rearl_jax.data.survey.trial import tried
from rearl_jax.data.tables.canonical import find_tables
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem, ProblemError


def run(place: str) -> dict[str, Any]:
    """Interpretation of a file or folder, printed and returned as a record.

    Keys: file, format, command; for a table also form, rows_looked_at, columns (by their names in the file, each with
    canonical, unit, why), missing, doubts, recordings, notes, dropped. Nothing is written.

    Raises:
        MissingInputError: There is no such file.
        InvalidInputError: It is not a table, or cannot be read for the reason that is printed.
    """
    path = Path(place)
    if not path.exists():
        raise MissingInputError(Problem("file-missing", "there is no such file or folder", file=place))
    known = recognised(path)
    if known is not None:
        name, root = known
        command = command_of(DataConfig(DataFormat[name], str(root)))
        meaning = (import_module(f"rearl_jax.data.readers.{name}").__doc__ or "").partition("\n")[0]
        print_format(place, name, meaning, command)
        return {"file": place, "format": name, "command": command}
    sample = sample_of(find_tables(path)[0])
    present = [column.name for column in sample.columns]
    proposal = proposal_of(sample)
    judge_sides(proposal, sample)
    trial = None if proposal.missing else tried(place, proposal, [*present, *sample.twice])
    print_sample(sample, proposal)
    if trial is None:
        name, why = next(iter(proposal.missing.items()))
        if sample.twice:
            why += f"; left out, because they occur twice: {', '.join(sample.twice)}"
        raise InvalidInputError(Problem("column-missing", why, column=name, file=place))
    if trial.error is not None:
        raise trial.error
    command = command_of(trial.data)
    print_trial(trial, command)
    return {
        "file": place,
        "format": "table",
        "command": command,
        "form": sample.layout,
        "rows_looked_at": sample.n_rows,
        "columns": {
            taken.source: {"canonical": name, "unit": taken.unit, "why": taken.why}
            for name, taken in proposal.taken.items()
        },
        "refused": proposal.refused,
        "doubts": proposal.doubts,
        "recordings": trial.recordings,
        "notes": trial.notes,
        "dropped": trial.dropped,
    }


def recognised(path: Path) -> tuple[str, Path] | None:
    """Known format of a file or folder, and the value of data.root; None if no format recognises it."""
    for kind in DataFormat:
        recognises = reader_of(kind).recognises
        try:
            root = None if recognises is None else recognises(path)
        except ProblemError:
            continue  # damaged or of another kind; the reader of its format reports it
        if root is not None:
            return kind.name, root
    return None

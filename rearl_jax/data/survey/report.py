"""Text of a survey on standard output, and the command that reads recordings, quoted for a shell."""

import shlex
from collections import defaultdict
from collections.abc import Mapping

from rich.markup import escape

from rearl_jax.config.data import TABLE_KEYS, BadRows, DataConfig
from rearl_jax.config.quoting import quoted
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.data.survey.proposal import Proposal
from rearl_jax.data.survey.sample import Sample
from rearl_jax.data.survey.trial import Trial

_WIDTH = 110


def print_format(path: str, name: str, meaning: str, command: str) -> None:
    """Prints the known format of a file or folder."""
    print_notes(standard_output(_WIDTH), [f"{shown(path)} is in the format {name}: {meaning}", "read it with"])
    print(command)


def print_sample(sample: Sample, proposal: Proposal) -> None:
    """Prints the layout of a table and the proposed meaning of each column."""
    console = standard_output(_WIDTH)
    broken = f", {sample.n_broken} broken lines among them" if sample.n_broken else ""
    console.print(f"{escape(shown(str(sample.path)))}: {escape(sample.layout)}", highlight=False, soft_wrap=True)
    n_columns = len(sample.columns) + len(sample.twice)
    console.print(f"{n_columns} columns, {sample.n_rows} rows looked at{broken}", highlight=False)
    table = titled_table("Columns")
    for heading in ("column", "taken for", "unit", "why"):
        table.add_column(heading, overflow="fold")
    by_source = {taken.source: (name, taken) for name, taken in proposal.taken.items()}
    for column in sample.columns:
        name, taken = by_source.get(column.name, ("-", None))
        why = proposal.refused.get(column.name, f"holds {column.kind}") if taken is None else taken.why
        unit = (taken.unit or "") if taken is not None else ""
        table.add_row(*(escape(shown(text)) for text in (column.name, name, unit, why)))
    for name in sample.twice:
        table.add_row(escape(shown(name)), "-", "", "the name occurs twice, so no key can name it")
    console.print(table)
    names = defaultdict(list)
    for name, why in proposal.missing.items():
        names[why].append(name)
    missing = [f"missing: {' and '.join(same)}: {shown(why)}" for why, same in names.items()]
    print_notes(console, [*missing, *(f"not certain: {shown(doubt)}" for doubt in proposal.doubts)])


def print_trial(trial: Trial, command: str) -> None:
    """Prints what the command reads, and the command."""
    console = standard_output(_WIDTH)
    for recording in trial.recordings[:10]:
        size = f"{recording['rows']} rows, {recording['vehicles']} vehicles"
        rate = f"{recording['frame_rate']:g} frames per second"
        print_notes(console, [f"{shown(recording['id'])}: {size}, {rate}"])
    if len(trial.recordings) > 10:
        print_notes(console, [f"and {len(trial.recordings) - 10} more recordings"])
    dropped = ", ".join(f"{cause} {number}" for cause, number in trial.dropped.items())
    print_notes(
        console, [f"note: {shown(note)}" for note in trial.notes] + ([f"dropped: {dropped}"] if dropped else [])
    )
    print_notes(console, ["read it with"])
    print(command)


def shown(text: str) -> str:
    """A text from a file without characters that would move the cursor or end the line."""
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in text)


def command_of(data: DataConfig) -> str:
    """The `rearl prepare` command for recordings in files, its words quoted for the shell."""
    words = ["rearl", "prepare", f"data={data.format.name}"]
    if data.root is not None:
        words.append(f"data.root={quoted(data.root)}")
    for key in TABLE_KEYS:
        if given := getattr(data, key):
            words.append(f"data.{key}={mapping_text(given)}")
    if data.ring is not None:
        words.append(f"data.ring={data.ring:.10g}")
    if data.on_bad is not BadRows.stop:
        words.append(f"data.on_bad={data.on_bad.name}")
    return shlex.join(words)


def mapping_text(given: Mapping[str, object]) -> str:
    """A mapping as a value of the command line."""
    pairs = (f"{name}: {'null' if value is None else quoted(str(value))}" for name, value in given.items())
    return "{" + ", ".join(pairs) + "}"

"""The document of a study: results in tables, sections and figures."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from rearl_jax.data.records import RecordingInfo
from rearl_jax.document.recording_notes import merged_notes
from rearl_jax.document.table import Table


@dataclass(frozen=True)
class Section:
    """A part of a document.

    Attributes:
        title: Heading on the page.
        paragraphs: Sentences before its tables.
        tables: Tables of the section.
        notes: Points after its tables.
        is_folded: Whether the section is collapsed on the page and left out in the terminal.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
    is_folded: bool = False


@dataclass(frozen=True)
class DataSource:
    """A data set: name, attribution, licence, and notes."""

    name: str
    attribution: str
    licence: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Document:
    """Content of the terminal output and the page of a study.

    Attributes:
        title: Title.
        verdict: The result in one sentence.
        sections: Sections; the page shows collapsed ones below figures and data.
        command: The task as it is typed after `rearl`, such as `evaluate method=base`.
        generated: Whether any of the recordings were generated, not measured.
        data: The recordings in a sentence or two.
        sources: Data sets with their licences.
        captions: Text below each figure, by the figure's name; the page shows figures in this order.
    """

    title: str
    verdict: str
    sections: tuple[Section, ...]
    command: str
    generated: bool
    data: str = ""
    sources: tuple[DataSource, ...] = ()
    captions: Mapping[str, str] = field(default_factory=dict)


def data_sources(infos: Iterable[RecordingInfo]) -> tuple[DataSource, ...]:
    """Data sets of some recordings, each once with the notes of all its recordings."""
    notes: dict[tuple[str, str, str], list[tuple[str, ...]]] = {}
    for info in infos:
        notes.setdefault((info.source, info.attribution, info.licence), []).append(info.notes)
    return tuple(
        DataSource(name, attribution.rstrip("."), licence.rstrip("."), merged_notes(of_recordings))
        for (name, attribution, licence), of_recordings in notes.items()
    )

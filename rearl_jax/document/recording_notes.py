"""Notes on the recordings of a data set, for a reader: notes that differ only in their numbers become one."""

import re
from collections.abc import Iterable, Sequence

_NUMBER = re.compile(r"(?<!\S)\d+(?:\.\d+)?(?=[\s,;:)%]|$)")
"""A number that is a word of its own, not a part of the name of a recording or of a date."""

_MANY = 3
"""Notes that differ only in their numbers from this number on become one."""


def merged_notes(of_recordings: Iterable[Sequence[str]]) -> tuple[str, ...]:
    """Every note of the recordings once; of many that differ only in their numbers one, with their ranges."""
    count: dict[str, int] = {}
    for notes in of_recordings:
        for note in dict.fromkeys(notes):
            count[note] = count.get(note, 0) + 1
    similar: dict[str, list[str]] = {}
    for note in count:
        similar.setdefault(_NUMBER.sub("#", note), []).append(note)
    merged = []
    for notes in similar.values():
        if len(notes) < _MANY:
            merged += notes
        else:
            merged.append(f"{_with_ranges(notes)} ({sum(count[note] for note in notes)} recordings)")
    return tuple(merged)


def _with_ranges(notes: Sequence[str]) -> str:
    """The first note, with the range over all notes in place of every number that differs."""
    ranges = [sorted(set(numbers), key=float) for numbers in zip(*map(_NUMBER.findall, notes), strict=True)]
    texts = iter(f"{found[0]} to {found[-1]}" if len(found) > 1 else found[0] for found in ranges)
    return _NUMBER.sub(lambda _: next(texts), notes[0])

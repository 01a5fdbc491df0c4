"""Declaration of one configuration key: its default and its one-line documentation, in one place.

`rearl TASK --help` prints what is declared here, so a key cannot exist without a sentence that explains it.
"""

from collections.abc import Callable
from dataclasses import field
from typing import Any


def key(default: Any, help: str) -> Any:
    """Dataclass field of a configuration record, documented.

    Args:
        default: Default value; for a nested record its class (a fresh record is built from the class's own
            defaults) or a function of no arguments. A sequence is written as a tuple.
        help: One line: meaning, unit in brackets, source of the default. Without a source, the default was chosen for
            this project.

    Raises:
        ValueError: The text is empty or longer than one line, or the default is a list or dict.
    """
    metadata = _documented(help)
    if isinstance(default, (list, dict, set)):
        raise ValueError(f"the default {default!r} is mutable: write a tuple, or a record for named values")
    if callable(default):
        return field(default_factory=default, metadata=metadata)
    return field(default=default, metadata=metadata)


def group_key(record: type, default: Callable[[], Any] | None = None) -> Any:
    """Dataclass field for the record of a group of keys; its help text is the first line of the record's docstring.

    Args:
        record: Class of the record.
        default: Function of no arguments with another default than the class's own.
    """
    return key(record if default is None else default, (record.__doc__ or "").partition("\n")[0].rstrip("."))


def study_key(name: str) -> Any:
    """Dataclass field for the key `study` with its default."""
    return key(name, "name of the folder under results.root; the same name again replaces its files")


def mapping_key(help: str) -> Any:
    """Dataclass field for a mapping, empty by default, with a help text as of `key`.

    The mapping is mutable, so the hash of its record leaves it out; comparisons of records include it.

    Raises:
        ValueError: The text is empty or longer than one line.
    """
    return field(default_factory=dict, hash=False, metadata=_documented(help))


def _documented(help: str) -> dict[str, str]:
    """Metadata of a field with its help text."""
    if not help.strip() or "\n" in help:
        raise ValueError(f"the help text of a configuration key must be one non-empty line, got {help!r}")
    return {"help": help}

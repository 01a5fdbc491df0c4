"""Results of the checks."""

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """Severity of a finding."""

    ok = "ok"
    warn = "warn"
    """Works, but an optional part is missing, or a resource will run short."""
    fail = "fail"
    """Tasks will fail."""


@dataclass(frozen=True)
class Check:
    """One line of the report: what was checked, what was found, and the remedy, empty if none is needed."""

    name: str
    status: Status
    found: str
    remedy: str = ""


def ok(name: str, found: str) -> Check:
    """A line with nothing to do."""
    return Check(name, Status.ok, found)


def warn(name: str, found: str, remedy: str) -> Check:
    """A line about something that is missing but not needed."""
    return Check(name, Status.warn, found, remedy)


def fail(name: str, found: str, remedy: str) -> Check:
    """A line about something without which tasks fail."""
    return Check(name, Status.fail, found, remedy)

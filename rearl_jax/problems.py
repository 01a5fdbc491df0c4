"""Problems of what a user has given: records with a code, and the errors that carry them.

In: the places that check configurations, recordings, model files, folders of results. Out: one sentence for the user,
and for programs the code and the fields it is made of. A code keeps its meaning; the wording may change.
"""

from dataclasses import dataclass, replace
from typing import Any, Self


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        code: Short, stable name of the kind of problem, such as `column-missing`.
        fault: What is wrong, in words; with a key the predicate to it, such as `must be at least 1`.
        remedy: What to do about it; empty if `fault` contains it.
        file: File or folder at fault.
        key: Key at fault, of the configuration or within the file, by its full name.
        column: Column at fault, as named in the file; None for the table as a whole.
        line: Line at fault in a text file, from 1.
        row: First row at fault, 1 = first row of data; None for the table as a whole.
        value: What was given instead.
    """

    code: str
    fault: str
    remedy: str = ""
    file: str | None = None
    key: str | None = None
    column: str | None = None
    line: int | None = None
    row: int | None = None
    value: Any = None

    @property
    def message(self) -> str:
        """The place, what is wrong there, and what to do about it."""
        place = [] if self.file is None else [self.file]
        if self.column is not None:
            place.append(f"column {self.column}")
        if self.line is not None:
            place.append(f"line {self.line}")
        if self.row is not None:
            place.append(f"data row {self.row}")
        sentence = self.fault if self.key is None else f"{self.key} {self.fault}"
        if self.value is not None:
            sentence += f", got {self.value}"
        if self.remedy:
            sentence += f". Remedy: {self.remedy}."
        return f"{', '.join(place)}: {sentence}" if place else sentence


class ProblemError(Exception):
    """A problem that the user can correct.

    Attributes:
        problem: Which.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.problem = problem

    def __str__(self) -> str:
        return self.problem.message

    @property
    def code(self) -> str:
        """Code of the problem."""
        return self.problem.code

    def within(self, prefix: str) -> Self:
        """The same error, its key being a part of what the prefix names."""
        return type(self)(replace(self.problem, key=f"{prefix}{self.problem.key or ''}"))


class InvalidInputError(ProblemError, ValueError):
    """Something given has a value that cannot be used."""


class MissingInputError(ProblemError, FileNotFoundError):
    """A file or folder that was named is not there."""


def out_of_range(key: str, wanted: str, value: Any) -> InvalidInputError:
    """The error for a key whose value is none of those it may have.

    Args:
        key: Its name.
        wanted: What it must be, such as `must be at least 1`.
        value: What it is.
    """
    return InvalidInputError(Problem("out-of-range", wanted, key=key, value=value))

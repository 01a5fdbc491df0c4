"""Problems with a user's input: records with a code, and the errors that contain them.

Checks of configurations, recordings, model files and folders of results create these records. A record gives one
sentence for the user, and a code and fields for programs. A code keeps its meaning; the wording may change.
"""

from dataclasses import dataclass, replace
from typing import Any, Self


@dataclass(frozen=True)
class Problem:
    """One problem of the input.

    Attributes:
        code: Short, stable name of the kind of problem, such as `column-missing`.
        fault: Description of the problem; with a key a predicate, such as `must be at least 1`.
        remedy: Remedy; empty if `fault` contains it.
        file: File or folder at fault.
        key: Key at fault, of the configuration or within the file, by its full name.
        column: Column at fault, as named in the file; None for the table as a whole.
        line: Line at fault in a text file, from 1.
        row: First row at fault, 1 = first row of data; None for the table as a whole.
        value: The given value.
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
        """Sentence with place, problem and remedy."""
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
        problem: Record of the problem.
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
        """The same error, with the prefix put before its key."""
        return type(self)(replace(self.problem, key=f"{prefix}{self.problem.key or ''}"))


class InvalidInputError(ProblemError, ValueError):
    """An input has an invalid value."""


class MissingInputError(ProblemError, FileNotFoundError):
    """A named file or folder does not exist."""


def out_of_range(key: str, wanted: str, value: Any) -> InvalidInputError:
    """The error for a key with an invalid value.

    Args:
        key: Name of the key.
        wanted: Condition on the value, such as `must be at least 1`.
        value: The given value.
    """
    return InvalidInputError(Problem("out-of-range", wanted, key=key, value=value))

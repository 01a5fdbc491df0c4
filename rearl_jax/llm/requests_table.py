"""Table of the questions and their results with one row per request, and the counts so far.

Rows contain only the columns of the table, because a study may have a hundred thousand questions of several thousand
characters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rearl_jax.llm.records import TOKEN_COUNTS, Cause, Question, Reply

if TYPE_CHECKING:
    import pandas

COLUMNS = {
    "digest": "str",
    "second": "Int32",
    "scenario": "int32",
    "vehicle": "int32",
    "vote": "int8",
    "text": "str",
    "thinking_length": "int32",
    "finish": "str",
    "action": "int8",
    "cause": "str",
    "latency": "float64",
    "tries": "int16",
    "status": "Int16",
    **dict.fromkeys(TOKEN_COUNTS, "Int32"),
    "from_cache": "bool",
    "was_sent": "bool",
}
"""Columns of the table and their types in pandas; those not described here are the fields of `Question` and `Reply`.

`second` is that of the simulation, missing if it was not given; `vote` counts from 0; `thinking_length` is that of the
reasoning [characters]; `action` and `cause` refer to this reply alone; `was_sent` is false if the answer was stored or
an equal question was sent. `latency` and tokens summed over the rows with `was_sent` are those of the server.
"""


@dataclass(frozen=True)
class Counts:
    """Progress of a client.

    Attributes:
        questions: Questions submitted so far.
        answers: Questions with an answer or a cause.
        causes: Number of these questions by cause.
        kept: Chats whose answer was already stored.
        sent: Chats that were sent.
        tries: Times a chat was sent.
        waiting: Chats that are not sent yet.
        in_flight: Chats whose reply is pending.
    """

    questions: int
    answers: int
    causes: Mapping[Cause, int]
    kept: int
    sent: int
    tries: int
    waiting: int
    in_flight: int


def request_row(question: Question, reply: Reply, **others: Any) -> tuple[Any, ...]:
    """The row of one reply to one question, in the order of COLUMNS; `others` are the columns that neither record
    contains.
    """
    values = vars(question) | vars(reply) | {"thinking_length": len(reply.thinking)} | others
    return tuple(values[name] for name in COLUMNS)


def requests_frame(rows: Sequence[tuple[Any, ...]]) -> "pandas.DataFrame":
    """The table of some rows, in their order, with the columns and types of COLUMNS."""
    import pandas

    values = zip(*rows, strict=True) if rows else [()] * len(COLUMNS)
    columns = zip(COLUMNS.items(), values, strict=True)
    return pandas.DataFrame({name: pandas.Series(list(column), dtype=dtype) for (name, dtype), column in columns})

"""Table of the requests of a run, with one row per question and vote, and progress of the client.

A question may be asked several times; each answer is a vote. The table does not contain the texts of the questions,
because a study may ask a hundred thousand questions of several thousand characters.
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
"""Columns of the table and their types in pandas.

- `digest`: hash of the request, as in `Answer`; rows of equal requests have equal hashes.
- `second`: simulated time of the question [s]; missing if it was not given.
- `vote`: number of the vote on the question, from 0.
- `thinking_length`: length of the reasoning that the server returned [characters].
- `action` and `cause` are read from this reply, before the votes of a question are combined.
- `was_sent`: true in the first row of a request that was sent to the server. It is false if an earlier row has the same
  request, or if the request was not sent, for example because its answer was in the cache. Sums of `latency` and of
  tokens over the rows with `was_sent` therefore count every request once.

The other columns are fields of `Question` and `Reply`.
"""


@dataclass(frozen=True)
class Counts:
    """Progress of a client of the language model.

    `waiting` and `in_flight` are present numbers, all others are totals since the client started. A request asks for
    one vote on a question. Equal requests that are pending at the same time count as one.

    Attributes:
        questions: Questions submitted.
        answers: Questions whose result is known, with or without a usable answer.
        causes: Number of the questions in `answers` by their result: `answered`, or why there is no usable answer.
        kept: Requests that were not sent, because the cache contained their answer.
        sent: Requests that were sent, each counted once however often it was repeated after a failure.
        tries: Transmissions of all requests, with the repetitions.
        waiting: Requests that are still to be sent.
        in_flight: Requests that were sent and still lack a final reply.
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
    """Row of one reply to one question, in the order of COLUMNS.

    `others` are the values of the columns that neither `question` nor `reply` contains.
    """
    values = vars(question) | vars(reply) | {"thinking_length": len(reply.thinking)} | others
    return tuple(values[name] for name in COLUMNS)


def requests_frame(rows: Sequence[tuple[Any, ...]]) -> "pandas.DataFrame":
    """Table of the rows, in their order, with the columns and types of COLUMNS."""
    import pandas

    values = zip(*rows, strict=True) if rows else [()] * len(COLUMNS)
    columns = zip(COLUMNS.items(), values, strict=True)
    return pandas.DataFrame({name: pandas.Series(list(column), dtype=dtype) for (name, dtype), column in columns})

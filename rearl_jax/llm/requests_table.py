"""Questions and what they came to -> one row per request, as a table, and the counts so far.

A row holds what the table shows and nothing else: a study has a hundred thousand questions of some thousand characters.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from rearl_jax.llm.records import Cause, Question, Reply

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
    "prompt_tokens": "Int32",
    "cached_tokens": "Int32",
    "answer_tokens": "Int32",
    "from_cache": "bool",
    "was_sent": "bool",
}
"""Columns of the table, as in `RequestRow`, and their types in pandas."""


@dataclass(frozen=True)
class Counts:
    """How far a client is.

    Attributes:
        questions: Questions submitted so far.
        answers: Those of them that have an answer or a cause.
        causes: The same by cause.
        kept: Chats whose answer was kept from earlier.
        sent: Chats that were sent.
        tries: Times a chat was sent.
        waiting: Chats that are not sent yet.
        in_flight: Chats on their way.
    """

    questions: int
    answers: int
    causes: Mapping[Cause, int]
    kept: int
    sent: int
    tries: int
    waiting: int
    in_flight: int


class RequestRow(NamedTuple):
    """One reply to one question; fields not named here are those of `Question` and `Reply`.

    `latency` and tokens summed over the rows with `was_sent` are those of the server.

    Attributes:
        second: Second of the simulation; None where it was not given.
        vote: Number of the vote, from 0.
        thinking_length: Length of the reasoning [characters].
        action: The action understood in this reply alone.
        cause: What became of this reply alone.
        was_sent: Whether this question was sent; false where the answer was kept or an equal question was sent.
    """

    digest: str
    second: int | None
    scenario: int
    vehicle: int
    vote: int
    text: str | None
    thinking_length: int
    finish: str
    action: int
    cause: str
    latency: float
    tries: int
    status: int | None
    prompt_tokens: int | None
    cached_tokens: int | None
    answer_tokens: int | None
    from_cache: bool
    was_sent: bool


def request_row(
    question: Question,
    reply: Reply,
    *,
    digest: str,
    second: int | None,
    vote: int,
    action: int,
    cause: Cause,
    was_sent: bool,
) -> RequestRow:
    """The row of one reply; arguments as in `RequestRow`."""
    return RequestRow(
        digest=digest,
        second=second,
        scenario=question.scenario,
        vehicle=question.vehicle,
        vote=vote,
        text=reply.text,
        thinking_length=len(reply.thinking),
        finish=reply.finish,
        action=action,
        cause=cause.name,
        latency=reply.latency,
        tries=reply.tries,
        status=reply.status,
        prompt_tokens=reply.prompt_tokens,
        cached_tokens=reply.cached_tokens,
        answer_tokens=reply.answer_tokens,
        from_cache=reply.from_cache,
        was_sent=was_sent,
    )


def requests_frame(rows: list[RequestRow]) -> "pandas.DataFrame":
    """The table of some rows, in their order, with the columns and types of COLUMNS."""
    import pandas

    return pandas.DataFrame(
        {name: pandas.Series([getattr(row, name) for row in rows], dtype=dtype) for name, dtype in COLUMNS.items()}
    )

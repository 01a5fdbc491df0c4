"""Questions and what they came to -> one row per request, as a table."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

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
"""Columns of the table: those of `Question` and `Reply`, `second` of the simulation, `vote` counted from 0,
`thinking_length` in characters, `action` and `cause` of this reply alone, and `was_sent`: false where an equal
question had been sent already. `latency` and tokens summed over the rows with `was_sent` are those of the server."""


@dataclass(frozen=True, slots=True)
class RequestRow:
    """One reply to one question."""

    second: int | None
    question: Question
    vote: int
    digest: str
    reply: Reply
    action: int
    cause: Cause
    was_sent: bool


def requests_frame(rows: list[RequestRow]) -> "pandas.DataFrame":
    """The table of some rows, in their order, with the columns and types of COLUMNS."""
    import pandas

    replies = [row.reply for row in rows]
    values = {
        "digest": [row.digest for row in rows],
        "second": [row.second for row in rows],
        "scenario": [row.question.scenario for row in rows],
        "vehicle": [row.question.vehicle for row in rows],
        "vote": [row.vote for row in rows],
        "thinking_length": [len(reply.thinking) for reply in replies],
        "action": [row.action for row in rows],
        "cause": [row.cause.name for row in rows],
        "was_sent": [row.was_sent for row in rows],
    }
    of_replies = COLUMNS.keys() - values.keys()
    values |= {name: [getattr(reply, name) for reply in replies] for name in of_replies}
    return pandas.DataFrame({name: pandas.Series(values[name], dtype=dtype) for name, dtype in COLUMNS.items()})

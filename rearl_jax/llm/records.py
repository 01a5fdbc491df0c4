"""Records exchanged by the simulation, the prompts and the client."""

from dataclasses import dataclass, fields
from enum import Enum

NO_DECISION = -1
"""Action of a vehicle that stays with IDM and MOBIL."""


class Cause(Enum):
    """Result of a question: answered, or the cause why the vehicle is controlled by IDM and MOBIL."""

    answered = "answered"
    """One admissible action was understood."""
    unparsable = "unparsable"
    """The text contains no action, or several."""
    out_of_range = "out_of_range"
    """A number that is not an action."""
    inadmissible = "inadmissible"
    """An action the vehicle may not take now."""
    truncated = "truncated"
    """The text was cut off before an action."""
    disagreed = "disagreed"
    """No action has the majority of the votes."""
    late = "late"
    """No answer within the time-outs, or within the deadline of the questions of one second."""
    refused = "refused"
    """The server answered with an error that a retry cannot solve."""
    failed = "failed"
    """Every try failed: the server sent errors, broken replies or nothing."""
    broken = "broken"
    """Not sent: the circuit breaker is open, because the server was down."""
    not_kept = "not_kept"
    """Replay: the cache contains no answer."""

    @property
    def is_answer(self) -> bool:
        """True if the model has answered, whether or not the answer is usable."""
        return self not in (Cause.late, Cause.refused, Cause.failed, Cause.broken, Cause.not_kept)


@dataclass(frozen=True)
class Message:
    """One message of a chat: `system` or `user`, and its text."""

    role: str
    text: str


@dataclass(frozen=True)
class Question:
    """Question about one vehicle.

    Attributes:
        scenario: Column of the vehicle's scenario in the batch.
        vehicle: Row of the vehicle.
        messages: The chat, shared text first.
        choices: Identifiers of the admissible actions, in ascending order.
    """

    scenario: int
    vehicle: int
    messages: tuple[Message, ...]
    choices: tuple[int, ...]


@dataclass(frozen=True)
class Completion:
    """Completion of one chat, as sent by a server and as stored.

    The columns of the file of answers follow from these fields.

    Attributes:
        text: Text of the answer; None if there is none.
        thinking: Text the server returned as reasoning; logged, never an action.
        finish: Finish reason of the server (`stop`, `length`, ...); empty if not stated.
        prompt_tokens: Tokens of the chat; None if not stated.
        cached_tokens: Tokens of the chat that were in the server's prefix cache; None if not stated.
        answer_tokens: Tokens of the answer; None if not stated.
    """

    text: str | None = None
    thinking: str = ""
    finish: str = ""
    prompt_tokens: int | None = None
    cached_tokens: int | None = None
    answer_tokens: int | None = None


TOKEN_COUNTS = tuple(field.name for field in fields(Completion) if field.type == int | None)
"""Fields of a completion that count tokens."""

TEXTS = tuple(field.name for field in fields(Completion) if field.name not in TOKEN_COUNTS)
"""Fields of a completion that are texts."""


@dataclass(frozen=True, kw_only=True)
class Reply(Completion):
    """A completion from the server or from the cache, or the cause of its absence.

    Attributes:
        cause: `answered` if there is a text to parse; else the cause of its absence.
        latency: Time from the first sending to the last byte, all tries included [s]; 0 from the cache.
        tries: Number of times the chat was sent; 0 from the cache.
        status: Last HTTP status; None if there is none.
        from_cache: Whether the reply comes from the file of answers.
    """

    cause: Cause
    latency: float = 0.0
    tries: int = 0
    status: int | None = None
    from_cache: bool = False


@dataclass(frozen=True)
class Answer:
    """Result of a question.

    Attributes:
        action: The action to execute, NO_DECISION for none.
        cause: `answered`, or the cause why there is no action.
        replies: Replies, one per vote.
        digest: Hash of the chat and of everything sent with it, as in the cache.
    """

    action: int
    cause: Cause
    replies: tuple[Reply, ...]
    digest: str

"""Check for usable answers: without them, the result of a run would be that of traffic without corrections."""

from collections.abc import Mapping

from rearl_jax.llm.records import Cause
from rearl_jax.llm.requests_table import Counts
from rearl_jax.problems import InvalidInputError, Problem

MAX_UNUSABLE = 100
"""Number of questions after which a run is stopped: so many without a single usable answer, or so many in a row without
any answer.
"""

MAX_UNANSWERED = 0.5
"""Largest share of questions without an answer in a result; with more, it would be that of traffic without corrections.
"""

_RESUME = "give the same command again: answers received are stored"

_REMEDIES = {
    Cause.truncated: "raise llm.max_tokens, or see llm.thinking",
    Cause.unparsable: "choose another model, or see prompt.template and llm.constrained",
    Cause.not_kept: "replay with the configuration that the answers were asked with",
    Cause.late: "see the cause, or raise llm.read_timeout and llm.deadline, or lower llm.max_in_flight",
}


def check_usable(
    counts: Counts,
    reasons: Mapping[Cause, str],
    *,
    is_finished: bool,
    any_text: bool,
    unanswered_in_a_row: int,
    refused_in_a_row: int,
    most_refused: int,
) -> None:
    """Raise InvalidInputError if the answers are too few for a result, or further questions are pointless.

    Args:
        counts: Progress of the client.
        reasons: Last message of the server, by cause.
        is_finished: Whether there are no further questions.
        any_text: Whether any text of the model counts as a result.
        unanswered_in_a_row: Questions without an answer since the last answer.
        refused_in_a_row: Requests since the last answer that were refused independently of their content, for example
            without credit.
        most_refused: Number of such requests that stops the run.
    """
    if counts.answers == 0 or not (causes := {cause: n for cause, n in counts.causes.items() if n}):
        return
    is_answered = any(cause is Cause.answered or (any_text and cause.is_answer) for cause in causes)
    refused = max(refused_in_a_row, 0 if is_answered else causes.get(Cause.refused, 0))
    if refused >= most_refused:
        fault = f"the server refuses every request ({reasons.get(Cause.refused, 'no reason given')})"
        raise InvalidInputError(Problem("requests-refused", fault, f"correct what it names and {_RESUME}"))
    unanswered = {cause: n for cause, n in causes.items() if not cause.is_answer}
    n_unanswered = sum(unanswered.values())
    if not is_answered and (is_finished or counts.answers >= MAX_UNUSABLE):
        fault = f"none of {counts.answers} questions to the language model has a usable answer"
        raise _unusable("answers-unusable", fault, causes, reasons)
    if is_finished and n_unanswered > MAX_UNANSWERED * counts.answers:
        fault = f"{n_unanswered} of {counts.answers} questions to the language model have no answer"
        raise _unusable("answers-too-few", f"{fault}, more than {MAX_UNANSWERED:.0%}", unanswered, reasons)
    if unanswered_in_a_row >= MAX_UNUSABLE:
        fault = f"the last {unanswered_in_a_row} of {counts.answers} questions to the language model have no answer"
        raise _unusable("answers-too-few", fault, unanswered, reasons)


def _unusable(code: str, fault: str, causes: Mapping[Cause, int], reasons: Mapping[Cause, str]) -> InvalidInputError:
    most_frequent = max(causes, key=causes.__getitem__)
    counted = ", ".join(f"{cause.name} {n}" for cause, n in causes.items())
    why = f"; {reasons[most_frequent]}" if most_frequent in reasons else ""
    remedy = _REMEDIES.get(most_frequent, "correct the cause")
    return InvalidInputError(Problem(code, f"{fault} ({counted}{why})", f"{remedy}, and {_RESUME}"))

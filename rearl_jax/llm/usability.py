"""Check for usable answers: without any, the result of a run would be that of traffic without corrections."""

from collections.abc import Mapping

from rearl_jax.llm.records import Cause
from rearl_jax.llm.requests_table import Counts
from rearl_jax.problems import InvalidInputError, Problem

MAX_UNUSABLE = 100
"""Number of questions after which a run without a single usable answer is stopped."""

_REMEDIES = {
    Cause.truncated: "raise llm.max_tokens, or see llm.thinking",
    Cause.unparsable: "choose another model, or see prompt.template and llm.constrained",
    Cause.not_kept: "replay with the configuration that the answers were asked with",
    Cause.late: "raise llm.read_timeout and llm.deadline, or lower llm.max_in_flight",
}


_WITH_TEXT = (Cause.unparsable, Cause.out_of_range, Cause.inadmissible, Cause.truncated, Cause.disagreed)
"""Causes of questions that the model has answered, but not usably."""


def check_usable(
    counts: Counts,
    reasons: Mapping[Cause, str],
    *,
    is_finished: bool,
    any_text: bool,
    refused_in_a_row: int,
    most_refused: int,
) -> None:
    """Raise InvalidInputError if further questions are pointless.

    Args:
        counts: Progress of the client.
        reasons: Last message of the server, by cause.
        is_finished: Whether there are no further questions.
        any_text: Whether any text of the model counts as a result.
        refused_in_a_row: Requests since the last answer that were refused independently of their content, for example
            without credit.
        most_refused: Number of such requests that stops the run.
    """
    if counts.answers == 0 or not (causes := {cause: n for cause, n in counts.causes.items() if n}):
        return
    is_answered = any(cause in causes for cause in (Cause.answered, *(_WITH_TEXT if any_text else ())))
    refused = max(refused_in_a_row, 0 if is_answered else causes.get(Cause.refused, 0))
    if refused >= most_refused:
        fault = f"the server refuses every request ({reasons.get(Cause.refused, 'no reason given')})"
        remedy = "correct what it names and give the same command again: answers received are stored"
        raise InvalidInputError(Problem("requests-refused", fault, remedy))
    if is_answered or not (is_finished or counts.answers >= MAX_UNUSABLE):
        return
    commonest = max(causes, key=causes.__getitem__)
    counted = ", ".join(f"{cause.name} {n}" for cause, n in causes.items())
    why = f"; {reasons[commonest]}" if commonest in reasons else ""
    fault = f"none of {counts.answers} questions to the language model has a usable answer ({counted}{why})"
    raise InvalidInputError(
        Problem("answers-unusable", fault, _REMEDIES.get(commonest, "see the cause and correct it"))
    )

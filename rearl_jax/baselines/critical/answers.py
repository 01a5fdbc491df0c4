"""Parsing of answers of a language model: a mixture, or the reason why there is none."""

import json
from enum import Enum

from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.config.critical import shares_problem
from rearl_jax.reasoning import without_reasoning

SCHEMA = {
    "type": "object",
    "properties": {name: {"type": "number", "minimum": 0, "maximum": 1} for name in Mixture._fields},
    "required": list(Mixture._fields),
}
"""Schema of an answer; JSON Schema cannot express that the sum must not exceed 1."""


class Fault(Enum):
    """Reason why a text is not a mixture."""

    unparsable = "unparsable"
    """No JSON object with the three numbers."""
    out_of_range = "out_of_range"
    """A share outside 0 to 1, or a sum above 1."""


class BadAnswerError(ValueError):
    """A text that is not a mixture; the message can be shown to the language model."""

    def __init__(self, fault: Fault, message: str) -> None:
        super().__init__(message)
        self.fault = fault


def read_mixture(text: str) -> Mixture:
    """The mixture in a text: the JSON object between its first { and its last }, without reasoning.

    Raises:
        BadAnswerError: The text contains no mixture.

    Source: CRITICAL, main.py: the text between the braces.
    """
    answer = without_reasoning(text)
    if answer is None:
        raise BadAnswerError(Fault.unparsable, "its reasoning does not end")
    begin, end = answer.find("{"), answer.rfind("}")
    if begin < 0 or end < begin:
        raise BadAnswerError(Fault.unparsable, "it holds no JSON object in braces")
    try:
        values = json.loads(answer[begin : end + 1])
    except (ValueError, RecursionError):
        raise BadAnswerError(Fault.unparsable, "the text between its braces is not JSON") from None
    shares = []
    for name in Mixture._fields:
        value = values.get(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise BadAnswerError(Fault.unparsable, f"it has no number for {name!r}")
        shares.append(value)
    try:
        mixture = Mixture(*map(float, shares))
    except OverflowError:
        raise BadAnswerError(Fault.out_of_range, "a number is far outside 0 to 1") from None
    if problem := shares_problem(mixture):
        raise BadAnswerError(Fault.out_of_range, problem)
    return mixture

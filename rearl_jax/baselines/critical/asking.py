"""A language model as a proposer: prompts, and parsing of answers."""

import json
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple, TypeAlias

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from rearl_jax.baselines.critical.adaptation import Proposal, Trial
from rearl_jax.baselines.critical.answers import SCHEMA, BadAnswerError, read_mixture
from rearl_jax.baselines.critical.classes import CLASSES
from rearl_jax.baselines.critical.mixture import Mixture

NEAR_MISS_TIME = 1.5
"""Time to collision below which two vehicles count as a near miss [s]. Source: CRITICAL's near misses; the value is
that of `safety.ttc`, FHWA-HRT-08-051 (2008).
"""

_MAX_REPEATED = 200
"""Largest number of characters of a refused answer that the next prompt repeats."""


class Reply(NamedTuple):
    """Reply of the language model: the text, or None; and the cause of the outcome."""

    text: str | None
    cause: str


Ask: TypeAlias = Callable[[str, str, int, int], Reply]
"""Function from the system message, the user message, the round and the attempt within it to the reply."""


class LanguageModelProposer:
    """Proposer that queries a language model; see `adaptation.Propose`."""

    def __init__(self, ask: Ask, recorded: Mixture, *, attempts: int, history: int) -> None:
        """Prepares the proposer; no request is sent yet."""
        self._ask, self._recorded = ask, recorded
        self._attempts, self._history = attempts, history

    def __call__(self, number: int, trials: Sequence[Trial]) -> Proposal:
        """The proposal of a round.

        If an answer is not a mixture, the request is repeated with a reminder of the ranges. If there was no reply, the
        request is not repeated, because the client has already retried.
        """
        refused, why, cause = "", "", ""
        for attempt in range(1, self._attempts + 1):
            reply = self._ask(*self._messages(trials, attempt, refused, why), number, attempt)
            cause = reply.cause
            if reply.text is None:
                return Proposal(None, attempt, cause)
            try:
                return Proposal(read_mixture(reply.text), attempt, cause)
            except BadAnswerError as error:
                refused, why = reply.text.strip()[:_MAX_REPEATED], str(error)
        return Proposal(None, self._attempts, cause)

    def _messages(self, trials: Sequence[Trial], attempt: int, refused: str, why: str) -> tuple[str, str]:
        """The system message and the user message."""
        *past, now = trials
        variables = {
            "schema": json.dumps(SCHEMA),
            "classes": CLASSES,
            "near_miss": NEAR_MISS_TIME,
            "recorded": self._recorded,
            "now": now,
            "past": past[-self._history :] if self._history else [],
            "attempt": attempt,
            "attempts": self._attempts,
            "refused": refused,
            "why": why,
        }
        template = _template()
        system, user = (
            "".join(template.blocks[block](template.new_context(variables))).strip() for block in ("system", "user")
        )
        return system, user


@cache
def _template() -> Template:
    """The shipped template."""
    environment = Environment(
        loader=PackageLoader("rearl_jax.baselines.critical", ""),
        undefined=StrictUndefined,
        finalize=_written,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["shares"] = _shares
    return environment.get_template("prompt.txt.j2")


def _written(value: object) -> object:
    """Text of a value in the prompt."""
    return f"{value:.3g}" if isinstance(value, float) else value


def _shares(mixture: Mixture) -> str:
    """A mixture in the requested JSON form."""
    return json.dumps({name: round(share, 3) for name, share in mixture._asdict().items()})

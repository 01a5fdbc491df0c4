"""Refused parameters of a request: finds the parameter named in an error, and removes it from the request.

Servers refuse different parameters of OpenAI's interface. Most name the refused parameter, in a sentence or as a field
of the error.
"""

import json
import re
from typing import Any

from rearl_jax.llm.profiles import read_error

_REQUIRED = frozenset({"model", "messages"})
"""Parameters that every request needs."""

_OTHER_NAMES = {"max_tokens": "max_completion_tokens"}
"""Alternative names of parameters that some models refuse under the usual name."""

SYSTEM = "system"
"""Entry for the system message among the refused parameters; if refused, its text is put before the user's message."""

_REFUSED_SYSTEM = re.compile(
    r"(?:system|developer) (?:role|message|prompt|instruction)\w* (?:is |are )?(?:not|un)", re.IGNORECASE
)


def without(body: str, refused: tuple[str, ...]) -> str:
    """JSON of a body without refused parameters."""
    if not refused:
        return body
    changed: dict[str, Any] = json.loads(body)
    for name in refused:
        if name == SYSTEM:
            changed["messages"] = _without_system(changed["messages"])
        elif name in changed:
            value = changed.pop(name)
            if (other := _OTHER_NAMES.get(name)) is not None:
                changed[other] = value
    return json.dumps(changed, sort_keys=True, separators=(",", ":"))


def refused_parameter(body: str, content: bytes) -> str | None:
    """The parameter of a body that the content of its response names as refused; None if it names none."""
    text = content.decode("utf-8", "replace")
    optional = [name for name in json.loads(body) if name not in _REQUIRED]
    named = [(match.start(), name) for name in optional if (match := re.search(rf"(?<!\w){name}(?!\w)", text))]
    if named:
        return min(named)[1]
    has_system = any(message["role"] == "system" for message in json.loads(body)["messages"])
    return SYSTEM if has_system and _REFUSED_SYSTEM.search(read_error(content)) else None


def optional_parameters(body: str) -> list[str]:
    """Optional parameters of a body, those supported by the fewest servers first."""
    widespread = ["seed", "temperature", "max_tokens"]
    names = [name for name in json.loads(body) if name not in _REQUIRED]
    # -1: before the widespread ones.
    return sorted(names, key=lambda name: widespread.index(name) if name in widespread else -1)


def _without_system(messages: list[dict[str, str]]) -> list[dict[str, str]]:
    """The messages, with system messages put before the text of the first other message."""
    instructions = [message["content"] for message in messages if message["role"] == "system"]
    others = [message for message in messages if message["role"] != "system"]
    if not instructions or not others:
        return messages
    first = others[0] | {"content": "\n\n".join([*instructions, others[0]["content"]])}
    return [first, *others[1:]]

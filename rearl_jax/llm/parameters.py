"""Parameters of a request that a server refuses: which one its error names, and the request without it.

Servers differ in what they refuse of OpenAI's interface, and most name it: in a sentence, or as a field of the error.
"""

import json
import re
from typing import Any

from rearl_jax.llm.profiles import read_error

_NEEDED = frozenset({"model", "messages"})
"""Without these there is no question."""

_OTHER_NAMES = {"max_tokens": "max_completion_tokens"}
"""Names under which some models take a parameter that they refuse under its usual one."""

SYSTEM = "system"
"""Stands for the system message among the refused parameters; its text then begins the user's message."""

_REFUSED_SYSTEM = re.compile(r"system (?:role|message|prompt|instruction)\w* (?:is |are )?(?:not|un)", re.IGNORECASE)


def without(body: str, refused: tuple[str, ...]) -> str:
    """JSON of a body as a server takes it that refuses some parameters."""
    if not refused:
        return body
    changed: dict[str, Any] = json.loads(body)
    for name in refused:
        if name == SYSTEM:
            changed["messages"] = _in_one(changed["messages"])
        elif name in changed:
            value = changed.pop(name)
            if (other := _OTHER_NAMES.get(name)) is not None:
                changed[other] = value
    return json.dumps(changed, sort_keys=True, separators=(",", ":"))


def refused_parameter(body: str, content: bytes) -> str | None:
    """The parameter of a body that the response to it names as refused; None if it names none.

    Args:
        body: What was sent.
        content: Body of the response that refuses it.
    """
    said = content.decode("utf-8", "replace")
    optional = [name for name in json.loads(body) if name not in _NEEDED]
    named = [(match.start(), name) for name in optional if (match := re.search(rf"(?<!\w){name}(?!\w)", said))]
    if named:
        return min(named)[1]
    has_system = any(message["role"] == "system" for message in json.loads(body)["messages"])
    return SYSTEM if has_system and _REFUSED_SYSTEM.search(read_error(content)) else None


def optional_parameters(body: str) -> list[str]:
    """Parameters that a body may do without, those first that the fewest servers know."""
    known = ["max_tokens", "temperature", "seed"]
    names = [name for name in json.loads(body) if name not in _NEEDED]
    return sorted(names, key=lambda name: known[::-1].index(name) if name in known else -1)


def _in_one(messages: list[dict[str, str]]) -> list[dict[str, str]]:
    """The messages, those of the system at the beginning of the first other one."""
    begin = [message["content"] for message in messages if message["role"] == "system"]
    others = [message for message in messages if message["role"] != "system"]
    if not begin or not others:
        return messages
    first = others[0] | {"content": "\n\n".join([*begin, others[0]["content"]])}
    return [first, *others[1:]]

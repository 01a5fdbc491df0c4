"""Bodies of requests in a server's dialect, and completions from bodies of responses.

All servers support chat completions, but differ in how answers are restricted to choices and how reasoning is switched
off. Responses differ in field names only, so one function reads all of them.
"""

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rearl_jax.config.llm import LlmConfig, Profile, Thinking
from rearl_jax.llm.records import Completion, Message

_encode = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False).encode
"""Canonical JSON: the same object always gives the same text."""

_MAX_TOKENS = 2**31
"""Token counts from here on are errors of the server."""

_LONGEST_ERROR = 300
"""Number of characters that are shown of a server's error message."""


@dataclass(frozen=True)
class Dialect:
    """A server's extensions of OpenAI's interface.

    Attributes:
        profile: Name of the dialect.
        choice: Function from the allowed texts to the fields that restrict an answer to them; None if there are none.
        no_thinking: Fields that switch the reasoning off.
    """

    profile: Profile
    choice: Callable[[Sequence[str]], Mapping[str, Any]] | None
    no_thinking: Mapping[str, Any]


def _response_format(texts: Sequence[str]) -> dict[str, Any]:
    schema = {"type": "integer", "enum": [int(text) for text in texts]}
    return {"response_format": {"type": "json_schema", "json_schema": {"name": "action", "schema": schema}}}


_TEMPLATE_SWITCH = {"chat_template_kwargs": {"enable_thinking": False}}
"""Argument of the chat templates of Qwen3 and GLM; templates that do not know it ignore it."""

DIALECTS = {
    dialect.profile: dialect
    for dialect in (
        # For vLLM 0.12 and later, which silently ignores the earlier field guided_choice.
        Dialect(Profile.vllm, lambda texts: {"structured_outputs": {"choice": list(texts)}}, _TEMPLATE_SWITCH),
        Dialect(Profile.sglang, lambda texts: {"regex": f"({'|'.join(texts)})"}, _TEMPLATE_SWITCH),
        Dialect(Profile.ollama, _response_format, {"reasoning_effort": "none"}),
        Dialect(
            Profile.llamacpp,
            lambda texts: {"grammar": "root ::= " + " | ".join(f'"{text}"' for text in texts)},
            _TEMPLATE_SWITCH,
        ),
        Dialect(Profile.plain, None, {}),
    )
}


def is_constrained(config: LlmConfig, dialect: Dialect) -> bool:
    """True if answers are restricted to the choices.

    Never with reasoning, because some servers would restrict the reasoning to the choices too.
    """
    return config.constrained and dialect.choice is not None and config.thinking is not Thinking.on


def request_body(
    messages: Sequence[Message], choices: Sequence[int], *, model: str, dialect: Dialect, config: LlmConfig, seed: int
) -> str:
    """Canonical JSON of one request for a chat completion."""
    body: dict[str, Any] = {
        "model": model,
        "messages": [{"role": message.role, "content": message.text} for message in messages],
        "temperature": config.temperature,
        "seed": seed,
        "max_tokens": config.max_tokens,
    }
    if config.thinking is Thinking.off:
        body |= dialect.no_thinking
    if choices and is_constrained(config, dialect) and dialect.choice is not None:
        body |= dialect.choice([str(choice) for choice in choices])
    return _encode(body)


def request_digest(body: str, dialect: Dialect) -> str:
    """SHA-256 of the canonical JSON of a body, which names the model, and of the dialect it is written in.

    The server's address is not part of it, so that answers can be taken to another machine.
    """
    return hashlib.sha256(f'{{"body":{body},"profile":"{dialect.profile.name}"}}'.encode()).hexdigest()


def read_completion(content: bytes) -> Completion:
    """Completion in the body of a response.

    A response without a text gives the empty text if the model was cut off or returned only reasoning. A text in parts
    is joined, also one that is streamed in events; a number is its text; a refusal of the model is its text.

    Raises:
        ValueError: The content is not a chat completion: no JSON, an error, a different structure, no choices, or no
            text.
    """
    is_streamed = content.lstrip().startswith((b"data:", b"event:", b":"))
    body = _joined_events(content) if is_streamed else _object(read_json(content), "the response")
    choices = body.get("choices")
    if not isinstance(choices, list) or not choices:
        fault = "is an error" if body.get("error") else "has no choices"
        raise ValueError(f"the response {fault}: {read_error(content)}")
    choice = _object(choices[0], "the choice")
    if choice.get("error"):
        raise ValueError(f"the response is an error: {read_error(_encode(choice).encode())}")
    message = choice.get("message")
    if not isinstance(message, dict):
        raise ValueError(f"the choice has no message: {str(choice)[:_LONGEST_ERROR]}")
    finish = _text(choice.get("finish_reason"))
    try:
        text, thought = _content(message.get("content"))
    except RecursionError:
        raise ValueError("the content is nested too deeply") from None
    thinking = _text(message.get("reasoning_content")) or _text(message.get("reasoning")) or thought
    if text is None:
        text = message.get("refusal")
    if text is None and (thinking or finish == "length"):
        text = ""
    if not isinstance(text, str):
        only = ", ".join(map(_text, message))[:80] or "nothing"
        raise ValueError(f"the message has no text, only {only} (finish reason: {finish or 'none'})")
    usage, timings = _mapping(body.get("usage")), _mapping(body.get("timings"))
    details = _mapping(usage.get("prompt_tokens_details"))
    cached = _count(details.get("cached_tokens"))
    return Completion(
        text=_text(text),
        thinking=thinking,
        finish=finish,
        prompt_tokens=_count(usage.get("prompt_tokens")),
        cached_tokens=_count(timings.get("cache_n")) if cached is None else cached,  # llama.cpp's own field
        answer_tokens=_count(usage.get("completion_tokens")),
    )


def _joined_events(content: bytes) -> Mapping[str, Any]:
    """The completion whose parts are server-sent events, which some servers send without being asked to stream.

    Raises:
        ValueError: An event is not a part of a completion.
    """
    whole: dict[str, Any] = {}
    parts: dict[str, list[Any]] = {}
    finish = None
    for line in content.splitlines():
        name, _, data = line.partition(b":")
        if name.strip() != b"data" or data.strip() == b"[DONE]":
            continue
        event = _object(read_json(data), "the event")
        whole |= {key: value for key, value in event.items() if value is not None}
        choices = event.get("choices")
        for choice in choices if isinstance(choices, list) else []:
            choice = _object(choice, "the choice")
            if choice.get("index"):
                continue  # only the first answer counts
            finish = choice.get("finish_reason") or finish
            for key, value in _mapping(choice.get("delta", choice.get("message"))).items():
                if value is not None and key != "role":
                    parts.setdefault(key, []).append(value)
    if whole.get("error") or not parts:
        return whole | {"choices": None}
    joined = {key: "".join(map(_text, values)) if key != "content" else values for key, values in parts.items()}
    return whole | {"choices": [{"finish_reason": finish, "message": joined}]}


def _content(content: Any) -> tuple[str | None, str]:
    """Text and reasoning of a content: a text, a number, a part, or a list of these; None as text if it has none."""
    if isinstance(content, int | float) and not isinstance(content, bool):
        return str(content), ""
    if isinstance(content, list):
        texts, thoughts = zip(*map(_content, content), strict=True) if content else ((), ())
        known = [text for text in texts if text is not None]
        return "".join(known) if known else None, "".join(thoughts)
    if not isinstance(content, dict):
        return (_text(content) if isinstance(content, str) else None), ""
    if content.get("type") in ("thinking", "reasoning"):
        return None, _content(content.get("thinking", content.get("text")))[0] or ""
    return _content(content.get("text", content.get("refusal", content.get("value"))))


def read_error(content: bytes) -> str:
    """The error message of a server, on one line of at most `_LONGEST_ERROR` characters."""
    try:
        reported = json.loads(content)
    except (ValueError, RecursionError):
        reported = content.decode("utf-8", "replace")
    if isinstance(reported, dict):
        error = reported.get("error", reported)
        reported = error.get("message", error) if isinstance(error, dict) else error
    line = " ".join(_text(reported if isinstance(reported, str) else str(reported)).split())
    return line if len(line) <= _LONGEST_ERROR else f"{line[:_LONGEST_ERROR]} ..."


def stated_status(status: int, content: bytes) -> int:
    """HTTP status of a response; for an error in a good response, which some servers send, that error's.

    All good statuses count as 200, because some gateways answer with 201.
    """
    if not 200 <= status < 300:
        return status
    if b'"error"' not in content:
        return 200
    try:
        body = _mapping(read_json(content))
    except ValueError:
        return 200
    code = str(_mapping(body.get("error")).get("code"))
    return int(code) if not body.get("choices") and re.fullmatch("[45][0-9][0-9]", code) else 200


def read_json(content: bytes) -> Any:
    """The value of a JSON text.

    Raises:
        ValueError: The text is not JSON, or nested too deeply.
    """
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("the JSON is nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"the response is no JSON: {read_error(content) or 'it is empty'} ({error})") from None


def _object(value: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} is not a JSON object")
    return value


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _text(value: Any) -> str:
    """A value as text that can be encoded in UTF-8 (JSON may contain unpaired surrogates); the empty text for None."""
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else ""


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < _MAX_TOKENS else None

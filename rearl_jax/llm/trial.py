"""The trial request before the first question: tests whether a server answers, which parameters it refuses, and whether
it respects constraints.

Many servers silently ignore a constraint, and some refuse parameters that others need. A refused parameter is left out
of all requests with a message; a server that answers no form of the request is a problem.
"""

import logging
from typing import Any

from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.connection import Connection, Response
from rearl_jax.llm.listing import ServerError, refused_access, until_loaded
from rearl_jax.llm.parameters import SYSTEM, optional_parameters, refused_parameter, without
from rearl_jax.llm.profiles import Dialect, is_constrained, read_completion, request_body
from rearl_jax.llm.records import Message
from rearl_jax.llm.retries import retrying
from rearl_jax.problems import InvalidInputError, Problem

log = logging.getLogger(__name__)

_CHAT = (
    Message("system", "Answer in one word."),
    Message("user", "What is the capital of France? Reply with its name only."),
)
_CHOICES = (7, 8)
"""Choices of the trial question; no model would answer with one of them unless it is restricted to them."""

_MAX_NAMED = 8
"""Largest number of refused parameters that are left out one after another."""

_OF_CONTENT = (400, 415, 422)
"""HTTP statuses of a request that is refused because of its content."""


class RefusedTrialError(InvalidInputError):
    """The server refuses the trial request in every form."""

    def __init__(self, problem: Problem, status: int | None) -> None:
        super().__init__(problem)
        self.is_not_found = status in (404, 405)


async def try_out(
    connection: Connection, config: LlmConfig, model: str, dialect: Dialect, *, is_known: bool
) -> tuple[str, ...]:
    """Parameters that the server refuses, found by a trial request in the form of the questions; warns about ignored
    ones.

    Args:
        connection: The server.
        config: Options of the requests.
        model: Name of the model.
        dialect: Assumed dialect of the server.
        is_known: Whether the server has listed its models; if not, only an answer shows that it serves models.

    Raises:
        RefusedTrialError: The server refuses the request in every form.
        ServerError: The server gives no answer and has not listed its models.
    """
    body = request_body(_CHAT, _CHOICES, model=model, dialect=dialect, config=config, seed=config.seed)
    post = retrying(config, lambda response: not response.is_refusal and _text_of(response)[0] is None)

    async def send(refused: tuple[str, ...]) -> Response:
        path, content = "/chat/completions", without(body, refused).encode()
        if is_known:
            return await post(connection.post, path, content)
        return await until_loaded(connection, config)(post, connection.post, path, content)

    refused: tuple[str, ...] = ()
    response = first = await send(())
    while response.status in _OF_CONTENT and len(refused) < _MAX_NAMED:
        name = refused_parameter(without(body, refused), response.content)
        if name is None or name in refused:
            break
        refused = (*refused, name)
        response = await send(refused)
    if response.status in _OF_CONTENT:
        response, refused = await _without_unnamed(send, body, refused, response)
    if response.is_refusal:
        raise _refusal(connection, config, dialect, first if first.is_refusal else response)
    for name in refused:
        log.warning("the server at %s refuses %s: requests are sent %s", connection.place, *_refusal_words(name))
    _check_answer(connection, config, dialect, response, refused, is_known=is_known)
    return refused


async def _without_unnamed(
    send: Any, body: str, refused: tuple[str, ...], response: Response
) -> tuple[Response, tuple[str, ...]]:
    """The response without a parameter that the server refuses but does not name: one at a time, then all."""
    names = [name for name in optional_parameters(without(body, refused)) if name not in refused]
    for more in [*((name,) for name in names), tuple(names)]:
        tried = await send((*refused, *more))
        if tried.status == 200:
            return tried, (*refused, *more)
    return response, refused


def _check_answer(
    connection: Connection,
    config: LlmConfig,
    dialect: Dialect,
    response: Response,
    refused: tuple[str, ...],
    *,
    is_known: bool,
) -> None:
    """Warn about an answer that violates the constraint, or a missing answer."""
    text, why = _text_of(response)
    if text is None:
        why = connection.without_key(why)
        if not is_known:
            message = f"the server at {connection.place} answers no question ({why})"
            raise ServerError(Problem("server-unknown", message, "check decision.server and llm.model"))
        log.warning("the server at %s did not answer the trial request: %s", connection.place, why)
        return
    if not text.strip():
        log.warning(
            "the server at %s answered the trial request with no text: if its model reasons before it answers, raise "
            "llm.max_tokens or see llm.thinking",
            connection.place,
        )
    is_respected = text.strip().strip('"') in {str(choice) for choice in _CHOICES}
    sent = set(dialect.choice([])) if dialect.choice is not None else set()
    if is_constrained(config, dialect) and not is_respected and not sent & set(refused):
        log.warning(
            "the server at %s ignores the constraint of llm.profile=%s: answers are not restricted to the admissible "
            "actions (asked for %s it answered %r)",
            connection.place,
            dialect.profile.name,
            " or ".join(map(str, _CHOICES)),
            connection.without_key(text[:40]),
        )


def _refusal(connection: Connection, config: LlmConfig, dialect: Dialect, response: Response) -> InvalidInputError:
    """The problem with a refusal that no parameter explains."""
    http = connection.without_key(response.reason)
    if response.status in (401, 403):
        return refused_access(connection, config, http)
    if response.status in _OF_CONTENT and is_constrained(config, dialect):
        fault = f"is refused by the server at {connection.place} ({http})"
        remedy = "set llm.profile, llm.thinking=none or llm.constrained=false"
        name = dialect.profile.name
        problem = Problem("dialect-refused", fault, remedy, key="llm.profile", value=name)
    else:
        fault = f"the server at {connection.place} refuses every request ({http})"
        problem = Problem("request-refused", fault, "correct what it names, or check decision.server and llm.model")
    return RefusedTrialError(problem, response.status)


def _refusal_words(name: str) -> tuple[str, str]:
    """Words of a log message: the refused parameter, and what is sent instead."""
    if name == SYSTEM:
        return "a message of the system", "with its text in the message of the user"
    return name, "with max_completion_tokens" if name == "max_tokens" else "without it"


def _text_of(response: Response) -> tuple[str | None, str]:
    """Text of a completion and an empty string; without a completion None and the problem."""
    if response.status != 200:
        return None, response.reason
    try:
        return read_completion(response.content).text, ""
    except ValueError as error:
        return None, str(error)

"""Finds from the server's address and the configuration which model is asked, in which dialect; or raises a problem.

Before the first question the server must respond, have loaded the model and list its name. A test request shows whether
it restricts answers to the choices, because many servers silently ignore the restriction.
"""

import logging
from dataclasses import dataclass, replace
from typing import Any

from tenacity import RetryCallState, stop_before_delay, wait_fixed

from rearl_jax.config.llm import LlmConfig, Profile
from rearl_jax.llm.answers import Answers, answers_path
from rearl_jax.llm.connection import Connection, Response
from rearl_jax.llm.profiles import (
    DIALECTS,
    Dialect,
    is_constrained,
    read_completion,
    read_error,
    read_json,
    request_body,
)
from rearl_jax.llm.records import Message
from rearl_jax.llm.retries import retrying
from rearl_jax.problems import InvalidInputError, Problem, ProblemError

log = logging.getLogger(__name__)

_POLL = 1.0
"""Pause before a server that is loading is asked again [s]."""

_PATIENCE = 10.0
"""Longest time without a byte of a request that needs no model [s]."""

_CANARY = (Message("user", "What is the capital of France? Reply with its name only."),)
_CANARY_CHOICES = (7, 8)
"""Choices that no model answers to that question unless it is restricted to them."""

_MAKERS = {"vllm": Profile.vllm, "sglang": Profile.sglang, "llamacpp": Profile.llamacpp}
"""Servers that name themselves as the owner of their models."""


class ServerError(ProblemError, ConnectionError):
    """There is no server, or it does not become ready."""


@dataclass(frozen=True)
class Server:
    """Model and server software that the questions go to."""

    model: str
    dialect: Dialect


async def meet(connection: Connection, config: LlmConfig) -> Server:
    """Waits until the server is there and knows the model; warns if answers are not constrained.

    Raises:
        ServerError: There is no server, or it does not become ready.
        InvalidInputError: It does not have the model, or refuses what it is sent.
    """
    model, response = await find_model(connection, config)
    profile = config.profile
    if profile is Profile.auto:
        profile = await _recognise(connection, response)
        log.info("the server at %s is taken for llm.profile=%s", connection.address, profile.name)
    server = Server(model, DIALECTS[profile])
    await _try_constraint(connection, config, server)
    return server


async def find_model(connection: Connection, config: LlmConfig) -> tuple[str, Response]:
    """Name the server knows the wanted model by, and its list of models; raises as `meet` does."""
    response = await _models(connection, config)
    return _choose_model([model["id"] for model in _entries(response)], config.model, connection.address), response


def replayed(answers: Answers, config: LlmConfig) -> Server:
    """The model whose answers are replayed.

    Raises:
        InvalidInputError: The configuration fits none of the kept models, or several.
    """
    kept = answers.sources()
    fitting = [
        (model, profile)
        for model, profile in kept
        if config.model in ("", model) and config.profile in (Profile.auto, profile)
    ]
    if len(fitting) != 1:
        listed = ", ".join(f"llm.model={model} llm.profile={profile.name}" for model, profile in kept) or "nothing"
        message = f"fits {len(fitting)} of the kept models, not one, with llm.profile={config.profile.name} ({listed})"
        remedy = "set llm.model and llm.profile to one of them"
        file, name = str(answers_path(config)), repr(config.model)
        raise InvalidInputError(Problem("kept-model", message, remedy, file=file, key="llm.model", value=name))
    ((model, profile),) = fitting
    return Server(model, DIALECTS[profile])


async def _models(connection: Connection, config: LlmConfig) -> Response:
    """The response with the list of models."""
    asked = retrying(config, lambda response: not (_is_list(response) or response.is_refusal or _is_loading(response)))
    waited = retrying(
        config,
        _is_loading,
        wait=wait_fixed(_POLL),
        stop=stop_before_delay(config.startup),
        before_sleep=lambda state: _say_once(state, connection, config),
    )
    response = await waited(asked, connection.get, "/models", _PATIENCE)
    if _is_loading(response):
        message = f"the server at {connection.address} is still loading after {config.startup:g} s"
        raise ServerError(
            Problem("server-loading", message, "start rearl again when it is ready, or raise llm.startup")
        )
    if not _is_list(response):
        raise _no_server(connection, config, response)
    return response


def _is_loading(response: Response) -> bool:
    return response.status in (429, 503)


def _say_once(state: RetryCallState, connection: Connection, config: LlmConfig) -> None:
    if state.attempt_number == 1:
        log.info("the server at %s is loading: waiting up to %g s", connection.address, config.startup)


def _no_server(connection: Connection, config: LlmConfig, response: Response) -> ProblemError:
    """The problem with a response to the question for models that is not a list of models."""
    address, status = connection.address, response.status
    http = f"HTTP {status}: {connection.without_key(read_error(response.content))}"
    if status is None:
        message = f"no server answers at {address} ({response.error})"
        return ServerError(Problem("server-absent", message, "start one there, or set decision.server"))
    if status in (401, 403):
        remedy = f"put its key into the environment variable {config.api_key_env or 'that llm.api_key_env names'}"
        return InvalidInputError(Problem("server-key", f"the server at {address} refuses access ({http})", remedy))
    if status >= 500:
        return ServerError(Problem("server-fails", f"the server at {address} reports an error ({http})", "restart it"))
    message = f"the program that answers at {address} is not an OpenAI-compatible server (HTTP {status} for /models)"
    return InvalidInputError(Problem("server-unknown", message, "check decision.server"))


def _entries(response: Response) -> list[dict[str, Any]]:
    """The models of a list of models; ValueError if it is not such a list."""
    listed = read_json(response.content)
    models = listed.get("data") if isinstance(listed, dict) else None
    # Ollama without a model says null.
    if models is None and isinstance(listed, dict) and listed.get("object") == "list":
        return []
    if not isinstance(models, list):
        raise ValueError("no list of models")
    return [model for model in models if isinstance(model, dict) and isinstance(model.get("id"), str)]


def _is_list(response: Response) -> bool:
    try:
        _entries(response)
    except ValueError:
        return False
    return response.status == 200


def _choose_model(names: list[str], wanted: str, address: str) -> str:
    """The name the server knows the wanted model by; the empty name stands for its only one."""
    listed = ", ".join(names) or "none"
    if not wanted and len(names) == 1:
        return names[0]
    for name in (wanted, f"{wanted}:latest"):  # Ollama's name for a model without a tag
        if name in names:
            return name
    message = f"must be one of the models of the server at {address} ({listed})"
    problem = Problem("choice-unknown", message, "set it to one of them, or load it there", key="llm.model")
    raise InvalidInputError(replace(problem, value=repr(wanted)))


async def _recognise(connection: Connection, response: Response) -> Profile:
    """The dialect of a server from its own description."""
    makers = {str(model.get("owned_by")) for model in _entries(response)}
    for maker, profile in _MAKERS.items():
        if maker in makers:
            return profile
    if response.server.lower().startswith("llama.cpp"):
        return Profile.llamacpp
    # Only Ollama reports its version there.
    version = await connection.get("/../api/version", _PATIENCE)
    try:
        if version.status == 200 and isinstance(read_json(version.content)["version"], str):
            return Profile.ollama
    except (ValueError, KeyError, TypeError):
        pass
    log.warning(
        "the server at %s does not state its software: llm.profile=plain, without constraints and without switching "
        "the reasoning off; set llm.profile if it is one of vllm, sglang, ollama, llamacpp",
        connection.address,
    )
    return Profile.plain


async def _try_constraint(connection: Connection, config: LlmConfig, server: Server) -> None:
    """Sends a question whose answer is none of the choices, which shows whether the server ignores constraints."""
    if not is_constrained(config, server.dialect):
        return
    body = request_body(
        _CANARY, _CANARY_CHOICES, model=server.model, dialect=server.dialect, config=config, seed=config.seed
    )
    tried = retrying(config, lambda response: not response.is_refusal and _text_of(response)[0] is None)
    response = await tried(connection.post, "/chat/completions", body.encode())
    if response.is_refusal:
        message = connection.without_key(read_error(response.content))
        refused = f"is refused by the server at {connection.address} (HTTP {response.status}: {message})"
        remedy = "set llm.profile, llm.thinking=none or llm.constrained=false"
        name = server.dialect.profile.name
        raise InvalidInputError(Problem("dialect-refused", refused, remedy, key="llm.profile", value=name))
    text, problem = _text_of(response)
    if text is None:
        log.warning(
            "whether the server at %s constrains answers could not be tested: %s",
            connection.address,
            connection.without_key(problem),
        )
    elif text.strip().strip('"') not in {str(choice) for choice in _CANARY_CHOICES}:
        log.warning(
            "the server at %s ignores the constraint of llm.profile=%s: answers are not restricted to the admissible "
            "actions (asked for %s it answered %r)",
            connection.address,
            server.dialect.profile.name,
            " or ".join(map(str, _CANARY_CHOICES)),
            connection.without_key(text[:40]),
        )


def _text_of(response: Response) -> tuple[str | None, str]:
    """Text of a completion, None without one, and then the problem."""
    if response.status != 200:
        return None, response.error or f"HTTP {response.status}"
    try:
        return read_completion(response.content).text, ""
    except ValueError as error:
        return None, str(error)

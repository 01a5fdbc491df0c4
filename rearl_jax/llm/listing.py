"""The list of a server's models: waits until the server responds, and chooses the model.

For a server without such a list, the configured model is used.
"""

import logging
from dataclasses import replace
from typing import Any

from tenacity import AsyncRetrying, RetryCallState, stop_before_delay, wait_fixed

from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.connection import Connection, Response
from rearl_jax.llm.profiles import read_json
from rearl_jax.llm.proxies import exceptions_variable
from rearl_jax.llm.retries import retrying
from rearl_jax.problems import InvalidInputError, Problem, ProblemError

log = logging.getLogger(__name__)

_POLL = 1.0
"""Pause between requests to a server that is loading [s]."""

_MAX_LISTED = 20
"""Number of models that a message names; some servers list hundreds."""

PATIENCE = 10.0
"""Read time-out of a request that needs no model [s]."""


class ServerError(ProblemError, ConnectionError):
    """There is no server, or it does not become ready."""


async def find_model(connection: Connection, config: LlmConfig) -> tuple[str, Response | None]:
    """The server's name for the wanted model, and its list of models; None for a server without a list.

    An empty or partial list without the configured model counts as none.

    If the list is only found without the version in the address, the connection's address is changed accordingly.

    Raises:
        ServerError: There is no server, or it does not become ready.
        InvalidInputError: The server lacks the model, or no model is named and the server lists none.
    """
    response = await _models(connection, config)
    if not is_list(response) and response.status in (404, 405) and (other := without_version(connection.address)):
        versioned, connection.address = connection.address, other
        unversioned = await _models(connection, config)
        if is_list(unversioned):
            response = unversioned
        else:
            connection.address = versioned
    if is_list(response):
        names = [model["id"] for model in entries(response) if "*" not in model["id"]]
        if name := _choose_model(names, config.model):
            return name, response
        if not (config.model and _is_partial(response)):
            raise _no_model(names, config.model, connection.place)
    elif not config.model or (response.status is None and not response.timed_out):
        raise _no_server(connection, config, response)
    log.info(
        "the server at %s lists no such model (%s): it is asked for llm.model=%s",
        connection.place,
        response.error or f"HTTP {response.status}",
        config.model,
    )
    return config.model, None


def without_version(address: str) -> str:
    """An address without the `/v1` at its end; empty if it has none."""
    return address.removesuffix("/v1") if address.endswith("/v1") else ""


def entries(response: Response) -> list[dict[str, Any]]:
    """The models of a list of models; ValueError if it is not such a list."""
    listed = read_json(response.content)
    models = listed.get("data") if isinstance(listed, dict) else listed
    # Ollama sends null if it has no model.
    if models is None and isinstance(listed, dict) and listed.get("object") == "list":
        return []
    if not isinstance(models, list):
        raise ValueError("no list of models")
    return [model for model in models if isinstance(model, dict) and isinstance(model.get("id"), str)]


def is_list(response: Response) -> bool:
    """True if a response is a list of models."""
    try:
        entries(response)
    except ValueError:
        return False
    return response.status == 200


def until_loaded(connection: Connection, config: LlmConfig) -> AsyncRetrying:
    """Retries of a request while the server reports that it is loading, for `llm.startup` seconds."""
    return retrying(
        config,
        _is_loading,
        wait=wait_fixed(_POLL),
        stop=stop_before_delay(config.startup),
        before_sleep=lambda state: _log_once(state, connection, config),
    )


async def _models(connection: Connection, config: LlmConfig) -> Response:
    """The response to a request for the list of models."""
    asked = retrying(config, lambda response: not (is_list(response) or response.is_refusal or _is_loading(response)))
    response = await until_loaded(connection, config)(asked, connection.get, "/models", PATIENCE)
    if _is_loading(response):
        http = connection.without_key(response.reason)
        message = f"the server at {connection.place} is still loading after {config.startup:g} s ({http})"
        raise ServerError(
            Problem("server-loading", message, "start rearl again when it is ready, or raise llm.startup")
        )
    return response


def _is_loading(response: Response) -> bool:
    return response.status in (429, 503) and not response.is_refusal


def _log_once(state: RetryCallState, connection: Connection, config: LlmConfig) -> None:
    if state.attempt_number == 1:
        log.info("the server at %s is loading: waiting up to %g s", connection.place, config.startup)


def _no_server(connection: Connection, config: LlmConfig, response: Response) -> ProblemError:
    """The problem for a response that is not a list of models."""
    place, status = connection.place, response.status
    http = connection.without_key(response.reason)
    if status is None:
        message = f"no server answers at {place} ({http})"
        remedy = "start one there, or set decision.server"
        if connection.is_proxied:
            remedy += f", or name its host in {exceptions_variable()} if it needs no proxy"
        return ServerError(Problem("server-absent", message, remedy))
    if status in (401, 403):
        return refused_access(connection, config, http)
    if status >= 500:
        return ServerError(Problem("server-fails", f"the server at {place} reports an error ({http})", "restart it"))
    message = f"the server at {place} lists no models ({http})"
    return InvalidInputError(
        Problem("server-unknown", message, "check decision.server, and name the model with llm.model")
    )


def refused_access(connection: Connection, config: LlmConfig, http: str) -> InvalidInputError:
    """The error for a server that rejects the key, or requires one."""
    remedy = f"put its key into the environment variable {config.api_key_env or 'that llm.api_key_env names'}"
    return InvalidInputError(Problem("server-key", f"the server at {connection.place} refuses access ({http})", remedy))


def _is_partial(response: Response) -> bool:
    """True if a list of models is empty or one page of several, or has patterns such as `openai/*`."""
    listed, models = read_json(response.content), entries(response)
    return (
        not models
        or any("*" in model["id"] for model in models)
        or (isinstance(listed, dict) and any(listed[name] for name in listed if name == "has_more" or "next" in name))
    )


def _choose_model(names: list[str], wanted: str) -> str | None:
    """The server's name for the wanted model; None if the server lacks it. An empty name selects the only model."""
    if not wanted and len(names) == 1:
        return names[0]
    for name in (wanted, f"{wanted}:latest"):  # Ollama's name for a model without a tag
        if name in names:
            return name
    matching = [name for name in names if wanted and name.endswith(f"/{wanted}")]  # listed as MAKER/MODEL
    return matching[0] if len(matching) == 1 else None


def _no_model(names: list[str], wanted: str, place: str) -> InvalidInputError:
    listed = ", ".join(names[:_MAX_LISTED]) or "none"
    if len(names) > _MAX_LISTED:
        listed += f" and {len(names) - _MAX_LISTED} more"
    message = f"must be one of the models of the server at {place} ({listed})"
    problem = Problem("choice-unknown", message, "set it to one of them, or load it there", key="llm.model")
    return InvalidInputError(replace(problem, value=repr(wanted)))

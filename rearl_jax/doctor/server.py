"""The server of a language model, where one is configured."""

import asyncio

from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.config.llm import LlmConfig
from rearl_jax.doctor.check import Check, fail, ok
from rearl_jax.llm.connection import Connection, Response, read_key, server_address
from rearl_jax.llm.local_server import LOCAL, local_model
from rearl_jax.llm.profiles import read_error, read_json

_PATIENCE = 5.0
"""Longest time without a byte [s]."""


def server_checks(decision: DecisionConfig, llm: LlmConfig) -> list[Check]:
    """One line where a language model decides or a server is named, else none. Nothing is asked of the model."""
    if decision.server == LOCAL:
        return [_local()] if decision.policy is PolicyName.llm else []
    try:
        address, key = server_address(decision.server), read_key(llm.api_key_env)
    except ValueError as error:
        return [fail("server", str(error), "decision.server=http://HOST:PORT/v1")]
    response = asyncio.run(_models(address, llm, key))
    if response.status is None:
        return [
            fail("server", f"nothing answers at {address} ({response.error})", "start it, or correct decision.server")
        ]
    if response.status != 200:
        said = f"{address} says HTTP {response.status}: {read_error(response.content)}"
        remedy = f"put the server's key into the environment variable {llm.api_key_env}"
        return [fail("server", said, remedy if response.status in (401, 403) else "look into the server's log")]
    return [_listed(address, response, llm.model)]


def _listed(address: str, response: Response, wanted: str) -> Check:
    try:
        models = [str(model["id"]) for model in read_json(response.content)["data"]]
    except (ValueError, KeyError, TypeError):
        return fail("server", f"{address} lists no models", "name a server with OpenAI's chat completions")
    found = f"{address} has {', '.join(models) or 'no model'}"
    if wanted and not {wanted, f"{wanted}:latest"} & set(models):
        return fail("server", found, f"load {wanted} there, or set llm.model to one it has")
    if not wanted and len(models) != 1:
        return fail("server", found, "set llm.model to one of them")
    return ok("server", found)


def _local() -> Check:
    try:
        return ok("server", f"local, {local_model().name}")
    except ImportError as error:
        return fail("server", str(error), "make llm, or decision.server=http://HOST:PORT/v1")


async def _models(address: str, llm: LlmConfig, key: str) -> Response:
    connection = Connection(address, llm, key)
    try:
        return await connection.get("/models", _PATIENCE)
    finally:
        await connection.close()

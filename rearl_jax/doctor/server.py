"""Check of the server of a language model, if one is configured."""

import asyncio
from dataclasses import replace

from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.config.llm import LlmConfig
from rearl_jax.doctor.check import Check, fail, ok
from rearl_jax.llm.connection import Connection, read_key, server_address
from rearl_jax.llm.listing import find_model
from rearl_jax.llm.local_server import LOCAL, local_model
from rearl_jax.problems import ProblemError


def server_checks(decision: DecisionConfig, llm: LlmConfig) -> list[Check]:
    """One line if a language model decides or a server is named, else none. No question is sent to the model."""
    if decision.server == LOCAL:
        return [_local()] if decision.policy is PolicyName.llm else []
    try:
        connection = Connection(server_address(decision.server), llm, read_key(llm.api_key_env))
        model, is_listed = asyncio.run(_model(connection, replace(llm, tries=1, startup=0.0)))
    except ProblemError as error:
        return [fail("server", replace(error.problem, remedy="").message, error.problem.remedy)]
    return [ok("server", f"{connection.place} " + (f"has {model}" if is_listed else "lists no models"))]


def _local() -> Check:
    try:
        return ok("server", f"local, {local_model().name}")
    except ImportError as error:
        return fail("server", str(error), "make llm, or decision.server=http://HOST:PORT/v1")


async def _model(connection: Connection, llm: LlmConfig) -> tuple[str, bool]:
    """Name of the model, and whether the server lists it."""
    try:
        model, listed = await find_model(connection, llm)
        return model, listed is not None
    finally:
        await connection.close()

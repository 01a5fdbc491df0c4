"""First contact with a server: determines model and dialect from the address and the configuration.

Before the first question the server must respond, have loaded the model and list its name, if it lists any. A trial
request shows whether it answers at all, what it refuses, and whether it restricts answers to the choices.
"""

import logging
from dataclasses import dataclass

from rearl_jax.config.llm import LlmConfig, Profile
from rearl_jax.llm.answers import Answers, answers_path
from rearl_jax.llm.connection import Connection, Response
from rearl_jax.llm.listing import PATIENCE, entries, find_model, without_version
from rearl_jax.llm.profiles import DIALECTS, Dialect, read_json
from rearl_jax.llm.trial import RefusedTrialError, try_out
from rearl_jax.problems import InvalidInputError, Problem

log = logging.getLogger(__name__)

_MAKERS = {"vllm": Profile.vllm, "sglang": Profile.sglang, "llamacpp": Profile.llamacpp}
"""Server software that names itself as the owner of its models."""


@dataclass(frozen=True)
class Server:
    """Model and server software that the questions go to.

    Attributes:
        model: Name of the model.
        dialect: Dialect of the server.
        refused: Parameters that the server refuses, see `parameters.without`.
    """

    model: str
    dialect: Dialect
    refused: tuple[str, ...] = ()


async def examine_server(connection: Connection, config: LlmConfig) -> Server:
    """The server's model and dialect; returned after it has responded, listed the model and answered a trial request.

    Raises:
        ServerError: There is no server, or it does not become ready.
        InvalidInputError: The server does not have the model, or refuses the trial request.
    """
    model, listed = await find_model(connection, config)
    profile = config.profile
    if profile is Profile.auto:
        profile = await _recognise(connection, listed)
        log.info("the server at %s is taken for llm.profile=%s", connection.place, profile.name)
    dialect = DIALECTS[profile]
    try:
        refused = await try_out(connection, config, model, dialect, is_known=listed is not None)
    except RefusedTrialError as error:
        other = without_version(connection.address)
        if listed is not None or not error.is_not_found or not other:
            raise
        versioned, connection.address = connection.address, other
        try:
            refused = await try_out(connection, config, model, dialect, is_known=False)
        except RefusedTrialError:
            connection.address = versioned
            raise error from None
    return Server(model, dialect, refused)


def replayed(answers: Answers, config: LlmConfig) -> Server:
    """The model whose answers are replayed.

    Raises:
        InvalidInputError: The configuration matches none of the stored models, or several.
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


async def _recognise(connection: Connection, listed: Response | None) -> Profile:
    """The dialect of a server from its own description."""
    makers = {str(model.get("owned_by")) for model in entries(listed)} if listed else set()
    for maker, profile in _MAKERS.items():
        if maker in makers:
            return profile
    if listed is not None and listed.server.lower().startswith("llama.cpp"):
        return Profile.llamacpp
    # Only Ollama reports its version there.
    version = await connection.get("/../api/version", PATIENCE)
    try:
        if version.status == 200 and isinstance(read_json(version.content)["version"], str):
            return Profile.ollama
    except (ValueError, KeyError, TypeError):
        pass
    log.warning(
        "the server at %s does not state its software: llm.profile=plain, without constraints and without switching "
        "the reasoning off; set llm.profile if it is one of vllm, sglang, ollama, llamacpp",
        connection.place,
    )
    return Profile.plain

"""A client that has to ask: answers kept from earlier would cost nothing."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.client import Client
from rearl_jax.llm.local_server import server_at


@contextmanager
def fresh_client(llm: LlmConfig, server: str) -> Iterator[Client]:
    """A client that knows no answer from before.

    Args:
        llm: Model, sampling and time-outs; its file of answers is left alone.
        server: Address, or `local`.

    Raises:
        ImportError: server=local, and the server or its model is not installed.
        OSError: There is no server, or it does not get ready.
        ValueError: The server does not have the model or refuses us.
    """
    with tempfile.TemporaryDirectory() as folder, server_at(server) as address:
        with Client(replace(llm, cache=str(Path(folder) / "answers.sqlite")), address) as client:
            yield client

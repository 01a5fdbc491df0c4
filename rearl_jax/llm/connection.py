"""A request -> what came back of it over HTTP, whatever a server does; the key of the server stays in here."""

import email.utils
import math
import os
import re
import ssl
import time
from dataclasses import dataclass
from functools import cache
from ipaddress import ip_address
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

import httpx

from rearl_jax import __version__
from rearl_jax.config.llm import LlmConfig

LARGEST_BODY = 4 * 2**20
"""A response that is larger is broken [bytes]: the longest reasoning is a hundredth of it."""

_IDLE = 4.0
"""Time after which an unused connection is not used again [s]: less than the 5 s after which uvicorn closes it."""

_SHORTEST_SECRET = 8
"""Shorter keys are placeholders, and would be found in ordinary words [characters]."""


def server_address(base_url: str) -> str:
    """The address under which `/models` and `/chat/completions` are found.

    Taken as it is where its path ends in a version such as `/v1`; `/chat/completions` behind it is left out, and
    where there is no version `/v1` is added.

    Raises:
        ValueError: It is no address of a server, or holds a password.
    """
    try:
        parts = urlsplit(base_url.strip())
        is_address = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        is_address = False
    if not is_address:
        # Not repeated where it could hold a password.
        shown = "" if "@" in base_url else f" {base_url!r}"
        raise ValueError(f"decision.server{shown} is no address of a server: write it like http://127.0.0.1:8000/v1")
    if "@" in parts.netloc:
        raise ValueError(
            "decision.server holds a user name or password: leave it out and put the key of the server into "
            "the environment variable that llm.api_key_env names"
        )
    path = parts.path.rstrip("/").removesuffix("/chat/completions").rstrip("/")
    if not re.search(r"/v\d+\w*$", path):
        path += "/v1"
    return f"{parts.scheme}://{parts.netloc}{path}"


def read_key(variable: str) -> str:
    """The key of the server from an environment variable; empty where it is not set.

    Raises:
        ValueError: It holds characters that no HTTP header can hold.
    """
    key = os.environ.get(variable, "").strip() if variable else ""
    if not (key.isascii() and key.isprintable()):
        raise ValueError(f"the environment variable {variable} holds characters that no key of a server has")
    return key


@dataclass(frozen=True)
class Response:
    """What came back.

    Attributes:
        status: HTTP status; None where there was no whole response.
        content: Its body.
        error: What went wrong without one; else empty.
        timed_out: Whether it was a time-out.
        retry_after: Time the server asks to be left alone [s]; None where it does not.
        server: How the server calls itself.
    """

    status: int | None = None
    content: bytes = b""
    error: str = ""
    timed_out: bool = False
    retry_after: float | None = None
    server: str = ""


class Connection:
    """Connections to one server, used by one event loop; no more requests at a time than it was made for."""

    def __init__(self, address: str, config: LlmConfig, key: str) -> None:
        """Nothing is sent yet.

        Args:
            address: As from `server_address`.
            config: Time-outs.
            key: Key of the server, or the empty text.
        """
        self.address = address
        self._key = key
        self._free: list[httpx.AsyncHTTPTransport] = []
        self._all: list[httpx.AsyncHTTPTransport] = []
        # Both are made once: httpx reads a text anew for every request.
        self._urls: dict[str, httpx.URL] = {}
        self._headers = httpx.Headers(
            {
                "accept": "application/json",
                "accept-encoding": "identity",
                "content-type": "application/json",
                "user-agent": f"rearl_jax/{__version__}",
            }
            | ({"authorization": f"Bearer {key}"} if key else {})
        )
        self._read_timeout = config.read_timeout
        self._timeouts = {
            "connect": config.connect_timeout,
            "read": config.read_timeout,
            "write": config.read_timeout,
            "pool": config.connect_timeout,
        }

    async def post(self, path: str, body: bytes) -> Response:
        """What comes back for a body sent there."""
        return await self._exchange("POST", path, body, self._timeouts)

    async def get(self, path: str, read_timeout: float) -> Response:
        """What is found there.

        Args:
            path: Behind the address; with `..` beside it.
            read_timeout: Longest time without a byte [s].
        """
        return await self._exchange(
            "GET", path, None, {**self._timeouts, "read": min(read_timeout, self._read_timeout)}
        )

    def without_key(self, text: str) -> str:
        """The text with the key of the server made unreadable, which a server may repeat."""
        if len(self._key) < _SHORTEST_SECRET:
            return text
        return text.replace(self._key, "***")

    async def close(self) -> None:
        """Closes all connections."""
        for lane in self._all:
            await lane.aclose()

    async def _exchange(self, method: str, path: str, body: bytes | None, timeouts: dict[str, float]) -> Response:
        lane = self._free.pop() if self._free else self._open_lane()
        try:
            request = httpx.Request(
                method,
                self._urls.get(path) or self._urls.setdefault(path, httpx.URL(self.address + path)),
                headers=self._headers,
                content=body,
                extensions={"timeout": timeouts},
            )
            response = await lane.handle_async_request(request)
            try:
                return await _read(response)
            finally:
                await response.aclose()
        except httpx.TimeoutException as error:
            return Response(error=_said(error), timed_out=True)
        except httpx.HTTPError as error:
            return Response(error=self.without_key(_said(error)))
        finally:
            self._free.append(lane)

    def _open_lane(self) -> httpx.AsyncHTTPTransport:
        """One connection, without the client around it, which follows redirects and keeps cookies.

        A pool of many connections looks through all of them at the beginning and end of every request, which with 32
        costs three times the processor time of everything else.
        """
        lane = httpx.AsyncHTTPTransport(
            limits=httpx.Limits(max_connections=1, max_keepalive_connections=1, keepalive_expiry=_IDLE),
            verify=_tls(),
            proxy=proxy_of(self.address),
        )
        self._all.append(lane)
        return lane


def proxy_of(address: str) -> str | None:
    """The proxy that the environment names for an address (`http_proxy`, `no_proxy` ...); none for this machine."""
    parts = urlsplit(address)
    host = parts.hostname or ""
    if _is_loopback(host) or proxy_bypass(host):
        return None
    proxies = getproxies()
    return proxies.get(parts.scheme) or proxies.get("all")


@cache
def _tls() -> ssl.SSLContext:
    """The certificates that are trusted, read once: it takes longer than a request."""
    return httpx.create_ssl_context()


async def _read(response: httpx.Response) -> Response:
    """The whole response, as long as it is not too large."""
    content = bytearray()
    async for part in response.aiter_bytes():
        content += part
        if len(content) > LARGEST_BODY:
            return Response(error=f"the response is larger than {LARGEST_BODY >> 20} MiB")
    return Response(
        status=response.status_code,
        content=bytes(content),
        retry_after=read_retry_after(response.headers.get("retry-after"), time.time()),
        server=response.headers.get("server", ""),
    )


def read_retry_after(value: str | None, now: float) -> float | None:
    """Seconds to wait that a Retry-After header asks for, in seconds or as a date; None where it does not say.

    Args:
        value: The header's value.
        now: Present time [s since 1970].
    """
    if value is None:
        return None
    try:
        seconds = float(value)
    except ValueError:
        try:
            seconds = email.utils.parsedate_to_datetime(value).timestamp() - now
        except (ValueError, OverflowError):
            return None
    return max(seconds, 0.0) if math.isfinite(seconds) else None


def _said(error: httpx.HTTPError) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"

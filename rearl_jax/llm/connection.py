"""HTTP connections to one server: failures are returned as data, and only this module uses the server's key."""

import email.utils
import math
import os
import re
import ssl
import time
from dataclasses import dataclass
from urllib.parse import urlsplit

import httpx

from rearl_jax.code_version import __version__
from rearl_jax.config._address import check_no_secret
from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.profiles import read_error, stated_status
from rearl_jax.llm.proxies import Proxy, proxy_for, unusable
from rearl_jax.problems import InvalidInputError, Problem

MAX_BODY_BYTES = 4 * 2**20
"""Size above which a response counts as broken [bytes]; the longest reasoning has a hundredth of it."""

_IDLE = 4.0
"""Time after which an unused connection is not used again [s]: less than the 5 s after which uvicorn closes it."""

_MIN_SECRET_LENGTH = 8
"""Length below which a key is regarded as a placeholder [characters]; removing it from messages would destroy ordinary
words.
"""

_EXHAUSTED = re.compile(
    rb"insufficient[_ ](?:quota|balance|credit|fund)|exceeded_current_quota|billing_hard_limit|credit balance|arrear",
    re.IGNORECASE,
)
"""Texts in responses with status 429 that indicate an exhausted account instead of a rate limit."""

_REQUEST_PATH = re.compile(
    r"(?<=/)(?:(?<=/v\d/)(?:chat|completions|models|responses|embeddings|messages)|api/(?:chat|generate|tags))$"
)
"""End of an address that is a request path of OpenAI's interface, or of Ollama's own interface, which is not used."""


def server_address(base_url: str) -> str:
    """Base address of `/models` and `/chat/completions`, with its query if it has one.

    `/chat/completions` at the end is removed, and so is another request path after the version. `/v1` is appended
    unless the path contains a version such as `v1`, `v1beta` or `v1.0`, or the query names a version, as for Azure.

    Raises:
        InvalidInputError: The text is not a server address, or contains a password or a key.
    """
    try:
        parts = urlsplit(base_url.strip())
        is_address = parts.scheme in ("http", "https") and _is_host(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        is_address = False
    if not is_address:
        message, remedy = "is not an address of a server", "write it like http://127.0.0.1:8000/v1"
        # Not shown if it could contain a password or a key.
        shown = None if set(base_url) & set("@?#") else repr(base_url)
        raise InvalidInputError(Problem("server-address", message, remedy, key="decision.server", value=shown))
    check_no_secret(base_url, "decision.server")
    path = _REQUEST_PATH.sub("", parts.path.rstrip("/"))
    is_whole = path.endswith("/chat/completions") or "api-version=" in parts.query
    path = path.removesuffix("/chat/completions").rstrip("/")
    if not is_whole and not re.search(r"/v\d[\w.]*(/|$)", path, re.IGNORECASE):
        path += "/v1"
    return f"{parts.scheme}://{parts.netloc}{path}" + (f"?{parts.query}" if parts.query else "")


def _is_host(name: str | None) -> bool:
    """False also for a name with white space, and for the `http` of `http://http://host`."""
    return bool(name) and not re.search(r"\s", name) and name not in ("http", "https")


def read_key(variable: str) -> str:
    """The key of the server from an environment variable; empty if it is not set.

    Raises:
        InvalidInputError: The key contains characters that are not allowed in HTTP headers.
    """
    key = os.environ.get(variable, "").strip() if variable else ""
    if not (key.isascii() and key.isprintable()):
        message = f"the environment variable {variable} holds characters that no key of a server has"
        raise InvalidInputError(Problem("server-key", message, "set it to the key of the server"))
    return key


@dataclass(frozen=True)
class Response:
    """Response of the server, or the error.

    Attributes:
        status: HTTP status, or that of an error in the body of a response with status 200; None without a response.
        content: Body of the response.
        error: Description of the failure if there was no whole response; else empty.
        timed_out: Whether it was a time-out.
        retry_after: Pause that the server requests [s]; None if it does not.
        patience: Longest pause after which a request may be sent again [s].
        server: Name that the server gives itself.
        location: Address that the server redirects to; empty if there is none.
    """

    status: int | None = None
    content: bytes = b""
    error: str = ""
    timed_out: bool = False
    retry_after: float | None = None
    patience: float = math.inf
    server: str = ""
    location: str = ""

    @property
    def reason(self) -> str:
        """Error message of a response that is not an answer, on one line."""
        if self.status is None:
            return self.error
        is_moved = 300 <= self.status < 400 and self.location
        return f"HTTP {self.status}: {f'it redirects to {self.location}' if is_moved else read_error(self.content)}"

    @property
    def is_refusal(self) -> bool:
        """True if the server refuses the request permanently; sending it again would not help."""
        if self.status is None or self.status < 300:
            return False
        if (self.retry_after or 0.0) > self.patience:
            return True
        if self.status == 429:
            return _EXHAUSTED.search(self.content) is not None
        return self.status < 500 and self.status != 408


class Connection:
    """Connections to one server for one event loop, one per pending request.

    Each connection is a separate `httpx.AsyncClient`. A single client with a pool checks all its connections at the
    beginning and end of every request, which costs 5.5 ms of processor time per request with 48 connections, against
    0.9 ms.
    """

    def __init__(self, address: str, config: LlmConfig, key: str) -> None:
        """Prepares the connections; nothing is sent yet. The address is that of `server_address`, the key may be empty.

        Raises:
            InvalidInputError: The environment names a proxy or certificates that cannot be used.
        """
        self.address, _, self._query = address.partition("?")
        self._key = key
        self._config = config
        self._proxy = proxy_for(self.address)
        self._tls = _certificates()
        self._free: list[httpx.AsyncClient] = []
        self._all: list[httpx.AsyncClient] = []
        # The first client is created at once to check the proxy.
        self._free.append(self._open())

    @property
    def place(self) -> str:
        """The address and its proxy, for messages."""
        return self.address if self._proxy is None else f"{self.address} (through {self._proxy})"

    @property
    def is_proxied(self) -> bool:
        """True if the server is reached through a proxy."""
        return self._proxy is not None

    async def post(self, path: str, body: bytes) -> Response:
        """The response to a body sent to a path."""
        return await self._exchange("POST", path, body, self._config.read_timeout)

    async def get(self, path: str, read_timeout: float) -> Response:
        """The response for a path below the address (or next to it, with `..`), with a read time-out [s]."""
        return await self._exchange("GET", path, None, min(read_timeout, self._config.read_timeout))

    def without_key(self, text: str) -> str:
        """The text with the server's key masked, because a server may repeat the key in its messages."""
        return text if len(self._key) < _MIN_SECRET_LENGTH else text.replace(self._key, "***")

    async def close(self) -> None:
        """Closes all connections."""
        for client in self._all:
            await client.aclose()

    async def _exchange(self, method: str, path: str, body: bytes | None, read_timeout: float) -> Response:
        client = self._free.pop() if self._free else self._open()
        timeout = httpx.Timeout(read_timeout, connect=self._config.connect_timeout)
        url = f"{self.address}{path}" + (f"?{self._query}" if self._query else "")
        try:
            async with client.stream(method, url, content=body, timeout=timeout) as response:
                return await _read(response, self._config.deadline)
        except httpx.TimeoutException as error:
            return Response(error=_error_text(error), timed_out=True)
        except (httpx.HTTPError, httpx.InvalidURL, UnicodeError) as error:
            return Response(error=self.without_key(_error_text(error)))
        finally:
            self._free.append(client)

    def _open(self) -> httpx.AsyncClient:
        headers = {
            "accept": "application/json",
            "accept-encoding": "identity",
            "content-type": "application/json",
            "user-agent": f"rearl_jax/{__version__}",
        }
        if self._key:
            headers["authorization"] = f"Bearer {self._key}"
        if self._key and "api-version=" in self._query:
            headers["api-key"] = self._key  # Azure's name for it
        try:
            client = httpx.AsyncClient(
                headers=headers,
                limits=httpx.Limits(max_connections=1, keepalive_expiry=_IDLE),
                proxy=self._proxy.url if self._proxy else None,
                trust_env=False,  # `proxy_for` has read the environment; httpx would also use variables of other hosts
                verify=self._tls,  # shared: reading the certificates takes longer than a request
            )
        except (ImportError, ValueError, httpx.InvalidURL) as error:
            raise _no_proxy(self._proxy, error) from None
        self._all.append(client)
        return client


def _certificates() -> ssl.SSLContext:
    try:
        return httpx.create_ssl_context()
    except (OSError, ValueError) as error:
        fault = f"names certificates that cannot be read ({error})"
        problem = Problem("certificates-unreadable", fault, "correct or unset it", key="SSL_CERT_FILE or SSL_CERT_DIR")
        raise InvalidInputError(problem) from None


def _no_proxy(proxy: Proxy | None, error: Exception) -> InvalidInputError:
    if proxy is None:
        raise error
    name = proxy.variable or "the system settings"
    if isinstance(error, ImportError):
        return unusable(name, f"names the SOCKS proxy {proxy.place}", "install the package socksio, as httpx[socks]")
    return unusable(name, "holds no address of a proxy", "write it as http://HOST:PORT")


async def _read(response: httpx.Response, patience: float) -> Response:
    """The whole response unless it is too large; `patience` [s] is stored in it."""
    content = bytearray()
    async for part in response.aiter_bytes():
        content += part
        if len(content) > MAX_BODY_BYTES:
            return Response(error=f"the response is larger than {MAX_BODY_BYTES >> 20} MiB")
    body = bytes(content)
    return Response(
        status=stated_status(response.status_code, body),
        content=body,
        retry_after=read_retry_after(response.headers.get("retry-after"), time.time()),
        patience=patience,
        server=response.headers.get("server", ""),
        location=response.headers.get("location", ""),
    )


def read_retry_after(value: str | None, now: float) -> float | None:
    """Wait [s] requested by a Retry-After header (seconds or a date), with `now` in seconds since 1970; else None."""
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


def _error_text(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__

"""The proxy for an address, from the usual environment variables.

`http_proxy`, `https_proxy` and `all_proxy`, in upper or lower case, or the proxy settings of the operating system, name
proxies. `no_proxy` names hosts, domains, patterns such as `*.org` and networks without a proxy; addresses of this
machine never use one.
"""

import os
from dataclasses import dataclass
from fnmatch import fnmatchcase
from ipaddress import ip_address, ip_network
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from rearl_jax.problems import InvalidInputError, Problem

SCHEMES = ("http", "https", "socks5", "socks5h")
"""Kinds of proxies that httpx supports."""


@dataclass(frozen=True)
class Proxy:
    """A proxy of the environment.

    Attributes:
        url: Address of the proxy, with its password if there is one.
        variable: Environment variable that names the proxy; empty for settings of the operating system.
        place: Host and port, for messages.
    """

    url: str
    variable: str
    place: str

    def __str__(self) -> str:
        return f"the proxy {self.place} of {self.variable or 'the system settings'}"


def proxy_for(address: str) -> Proxy | None:
    """The proxy through which an address is reached; None if it is reached directly.

    Raises:
        InvalidInputError: The variable contains no valid proxy address, or an unsupported kind of proxy.
    """
    parts = urlsplit(address)
    host, proxies = parts.hostname or "", getproxies()
    scheme = next((scheme for scheme in (parts.scheme, "all") if proxies.get(scheme)), None)
    if scheme is None or _is_loopback(host) or proxy_bypass(parts.netloc) or proxy_bypass(host) or _is_excepted(host):
        return None
    given = proxies[scheme].strip()
    url = given if "://" in given else f"http://{given}"
    wanted = f"{scheme}_proxy"
    variable = next((variable for variable in sorted(os.environ, reverse=True) if variable.lower() == wanted), "")
    if (secret := url.partition("://")[2].rpartition("@")[0]) and set(secret) & set("/?#@"):
        fault = "holds a user name or password with a character that addresses do not allow there"
        raise unusable(variable or wanted, fault, "write @ as %40, # as %23, / as %2F and ? as %3F")
    try:
        proxy = urlsplit(url)
        name = proxy.hostname or ""
        place = f"{f'[{name}]' if ':' in name else name}:{proxy.port or _port(proxy.scheme)}"
        is_proxy = bool(name) and " " not in name
    except ValueError:
        is_proxy, place = False, ""
    if not is_proxy or proxy.scheme.lower() not in SCHEMES:
        fault = "holds no address of a proxy" if not is_proxy else f"names a {proxy.scheme} proxy, which is not known"
        raise unusable(variable or wanted, fault, f"write it as {' or '.join(SCHEMES)}://HOST:PORT")
    return Proxy(url, variable, place)


def unusable(variable: str, fault: str, remedy: str) -> InvalidInputError:
    """The error for a variable that names a proxy that cannot be used."""
    remedy = f"{remedy}, or unset it, or name the server's host in {exceptions_variable()}"
    return InvalidInputError(Problem("proxy-unusable", fault, remedy, key=variable))


def exceptions_variable() -> str:
    """The variable that names hosts without a proxy: the one in lower case, even if empty, hides the other."""
    return "no_proxy" if "no_proxy" in os.environ else "NO_PROXY"


def _port(scheme: str) -> int:
    return {"http": 80, "https": 443}.get(scheme, 1080)


def _is_loopback(host: str) -> bool:
    """True for this machine, also for 0.0.0.0 and [::], which servers print as the address they listen to."""
    try:
        address = ip_address(host)
    except ValueError:
        return f".{host.rstrip('.')}".endswith(".localhost")
    return address.is_loopback or address.is_unspecified


def _is_excepted(host: str) -> bool:
    """True if `no_proxy` contains a pattern of this host or a network with this address."""
    excepted = [entry.strip().lower() for entry in os.environ.get(exceptions_variable(), "").split(",")]
    if any("*" in entry and fnmatchcase(host, entry) for entry in excepted):
        return True
    try:
        address = ip_address(host)
    except ValueError:
        return False
    for entry in excepted:
        try:
            if address in ip_network(entry.strip("[]"), strict=False):
                return True
        except ValueError:
            continue
    return False

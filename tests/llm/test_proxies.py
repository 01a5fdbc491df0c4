"""Proxies of the environment: which one counts for an address, and what is said of one that cannot be used."""

import asyncio
import os
import socket
import ssl

import pytest

from rearl_jax.llm.client import Client
from rearl_jax.llm.connection import Connection
from rearl_jax.llm.listing import ServerError
from rearl_jax.llm.proxies import proxy_for
from rearl_jax.problems import InvalidInputError
from tests.llm.asking import make_config
from tests.llm.stub import Stub
from tests.refusal import refused

ADDRESS = "http://model.invalid:8000/v1"


@pytest.fixture(autouse=True)
def no_proxies(monkeypatch):
    for name in list(os.environ):
        if name.lower().endswith("_proxy"):
            monkeypatch.delenv(name)


@pytest.mark.parametrize(
    ("variables", "address", "place", "variable"),
    [
        ({}, ADDRESS, None, None),
        ({"http_proxy": "http://127.0.0.1:9"}, ADDRESS, "127.0.0.1:9", "http_proxy"),
        ({"HTTP_PROXY": "proxy:3128"}, ADDRESS, "proxy:3128", "HTTP_PROXY"),
        ({"ALL_PROXY": "http://u:secret@p"}, ADDRESS, "p:80", "ALL_PROXY"),
        ({"https_proxy": "socks9://x"}, ADDRESS, None, None),
        ({"http_proxy": "http://a:1", "ALL_PROXY": "socks5://b:2"}, ADDRESS, "a:1", "http_proxy"),
        ({"http_proxy": "http://a:1", "NO_PROXY": "model.invalid"}, ADDRESS, None, None),
        ({"http_proxy": "http://a:1", "NO_PROXY": "invalid"}, ADDRESS, None, None),
        ({"http_proxy": "http://a:1", "no_proxy": "*"}, ADDRESS, None, None),
        ({"http_proxy": "http://a:1", "NO_PROXY": "10.0.0.0/8"}, "http://10.1.2.3:8000/v1", None, None),
        ({"http_proxy": "http://a:1", "NO_PROXY": "10.0.0.0/8"}, "http://11.1.2.3:8000/v1", "a:1", "http_proxy"),
        *(
            ({"http_proxy": "http://a:1"}, f"http://{host}:8000/v1", None, None)
            for host in ("localhost", "LOCALHOST.", "llm.localhost", "0.0.0.0", "[::]", "[::1]")
        ),
        ({"http_proxy": "http://a:1"}, "http://notlocalhost:8000/v1", "a:1", "http_proxy"),
        ({"http_proxy": " http://a:1\n"}, ADDRESS, "a:1", "http_proxy"),
        ({"http_proxy": "http://[fd00::1]:1"}, ADDRESS, "[fd00::1]:1", "http_proxy"),
        ({"http_proxy": "http://a:1", "NO_PROXY": "x, *.INVALID"}, ADDRESS, None, None),
        ({"http_proxy": "http://a:1", "NO_PROXY": "10.0.0.*"}, "http://10.0.0.7/v1", None, None),
        ({"http_proxy": "http://a:1", "NO_PROXY": "*.org"}, ADDRESS, "a:1", "http_proxy"),
        ({"http_proxy": "http://a:1", "no_proxy": "", "NO_PROXY": "model.invalid"}, ADDRESS, "a:1", "http_proxy"),
        ({"http_proxy": "http://a:1", "no_proxy": "", "NO_PROXY": "::/0"}, "http://[::2]:8000/v1", "a:1", "http_proxy"),
    ],
)
def test_proxy_for_an_address(monkeypatch, variables, address, place, variable):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    proxy = proxy_for(address)
    assert (proxy and proxy.place, proxy and proxy.variable) == (place, variable)
    assert "secret" not in str(proxy)


@pytest.mark.parametrize("value", ["socks4://127.0.0.1:1080", "ftp://x", "http://", "http://x:port", "http://x y:1"])
def test_a_proxy_that_cannot_be_used_is_named(tmp_path, monkeypatch, value):
    monkeypatch.setenv("ALL_PROXY", value)
    with refused("proxy-unusable", key="ALL_PROXY"):
        Connection(ADDRESS, make_config(tmp_path), "")


@pytest.mark.parametrize("separator", "@#/?")
def test_a_password_of_a_proxy_that_is_not_encoded_is_not_printed(tmp_path, monkeypatch, separator):
    monkeypatch.setenv("http_proxy", f"http://user:x7{separator}y8#z9@127.0.0.1:9")
    monkeypatch.setenv("no_proxy", "")
    with refused("proxy-unusable", key="http_proxy") as caught:
        Connection(ADDRESS, make_config(tmp_path), "")
    assert not any(part in str(caught.value) for part in ("x7", "y8", "z9"))
    assert "no_proxy" in caught.value.problem.remedy


@pytest.mark.parametrize("scheme", ["socks5", "socks5h"])
def test_an_error_names_the_package_that_a_socks_proxy_needs(tmp_path, monkeypatch, scheme):
    monkeypatch.setenv("ALL_PROXY", f"{scheme}://u:secret@127.0.0.1:1080")
    monkeypatch.setitem(__import__("sys").modules, "socksio", None)
    with refused("proxy-unusable", key="ALL_PROXY") as caught:
        Client(make_config(tmp_path), ADDRESS).open()
    assert "socksio" in caught.value.problem.remedy
    assert "secret" not in str(caught.value)


def test_a_request_that_fails_at_the_proxy_names_it(tmp_path, monkeypatch):
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    with refused("server-absent", ServerError) as caught:
        Client(make_config(tmp_path, tries=1), ADDRESS).open()
    assert "through the proxy 127.0.0.1:9 of http_proxy" in caught.value.problem.fault


def test_a_proxy_that_answers_itself_is_named(tmp_path, monkeypatch):
    with Stub(root="/nowhere") as proxy:
        monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{proxy.port}")
        with pytest.raises(InvalidInputError) as caught:
            Client(make_config(tmp_path, tries=1), ADDRESS).open()
    assert f"the proxy 127.0.0.1:{proxy.port} of http_proxy" in caught.value.problem.fault


def test_certificates_that_cannot_be_read_are_named(tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise ssl.SSLError("no certificate")

    monkeypatch.setattr("httpx.create_ssl_context", fail)
    with refused("certificates-unreadable"):
        Connection(ADDRESS, make_config(tmp_path), "")


@pytest.mark.parametrize(
    ("address", "asked"),
    [
        ("http://host:8000/v1", ("GET", "http://host:8000/v1/models")),
        ("https://host/v1", ("CONNECT", "host:443")),
        ("http://gpu.internal:8000/v1", None),
        ("http://127.0.0.1:9/v1", None),
        ("http://localhost:9/v1", None),
        ("http://[::1]:9/v1", None),
    ],
)
def test_a_proxy_is_used_except_for_local_and_excepted_addresses(monkeypatch, tmp_path, address, asked):
    """It is used for all addresses except those of this machine and those that `no_proxy` names."""
    resolve = socket.getaddrinfo

    def getaddrinfo(host, *others, **options):
        if host != "127.0.0.1":
            raise socket.gaierror(f"no {host}")
        return resolve(host, *others, **options)

    with Stub() as proxy:
        for name in ("http_proxy", "https_proxy"):
            monkeypatch.delenv(name, raising=False)
            monkeypatch.delenv(name.upper(), raising=False)
        monkeypatch.setenv("all_proxy", f"http://127.0.0.1:{proxy.port}")
        monkeypatch.setenv("no_proxy", ".internal")
        monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
        connection = Connection(address, make_config(tmp_path), "")

        async def ask():
            try:
                return await connection.get("/models", 5.0)
            finally:
                await connection.close()

        response = asyncio.run(ask())
    assert [(request.method, request.path) for request in proxy.log] == ([asked] if asked else [])
    assert (response.status is None) == (asked is None or asked[0] == "CONNECT")

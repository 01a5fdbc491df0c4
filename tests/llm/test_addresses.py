"""Addresses of servers: what is accepted, and secrets in them, which are not repeated."""

import pytest

from rearl_jax.config.decision import DecisionConfig
from rearl_jax.llm.connection import server_address
from tests.llm.asking import SECRET
from tests.refusal import refused


@pytest.mark.parametrize(
    ("given", "address"),
    [
        ("http://127.0.0.1:8000", "http://127.0.0.1:8000/v1"),
        ("http://127.0.0.1:8000/", "http://127.0.0.1:8000/v1"),
        (" http://127.0.0.1:8000/v1/ ", "http://127.0.0.1:8000/v1"),
        ("https://host/v1/chat/completions", "https://host/v1"),
        ("https://host/api/paas/v4", "https://host/api/paas/v4"),
        ("https://host/v1beta", "https://host/v1beta"),
        ("https://host/prefix", "https://host/prefix/v1"),
        ("http://[::1]:8000", "http://[::1]:8000/v1"),
        *((f"http://h/v1/{page}", "http://h/v1") for page in ("models", "chat", "completions/", "responses")),
        ("http://h:11434/api/chat", "http://h:11434/v1"),
        ("https://h/openai/v1/models", "https://h/openai/v1"),
        ("https://h/models", "https://h/models/v1"),
        ("http://host/v1beta/openai", "http://host/v1beta/openai"),
        ("https://host/openai/v1/", "https://host/openai/v1"),
        ("https://host/inference/chat/completions", "https://host/inference"),
        (
            "https://host/openai/deployments/m/chat/completions?api-version=2024-10-21",
            "https://host/openai/deployments/m?api-version=2024-10-21",
        ),
        ("https://host/openai/deployments/m?api-version=1", "https://host/openai/deployments/m?api-version=1"),
        ("https://host/ai?tenant=3", "https://host/ai/v1?tenant=3"),
        ("https://host/V1", "https://host/V1"),
        ("https://host/api/v1.0/", "https://host/api/v1.0"),
        ("https://host/dev1", "https://host/dev1/v1"),
    ],
)
def test_address_of_requests(given, address):
    assert server_address(given) == address


@pytest.mark.parametrize(
    "given",
    ["", "127.0.0.1:8000", "ftp://host", "http://", "http://host:99999", "http://host:x"]
    + ["http://a host/v1", "http://http://host/v1"],
)
def test_a_text_that_is_not_an_address_is_an_input_error(given):
    with refused("server-address", key="decision.server"):
        server_address(given)


@pytest.mark.parametrize(("scheme", "code"), [("http", "password-in-address"), ("ftp", "server-address")])
def test_address_with_a_password_is_refused_and_not_repeated(scheme, code):
    with refused(code) as caught:
        server_address(f"{scheme}://me:{SECRET}@host/v1")
    assert SECRET not in str(caught.value)


@pytest.mark.parametrize("end", [f"?key={SECRET}", f"?tenant=3&api_key={SECRET}", f"?{SECRET}", f"#{SECRET}"])
def test_address_with_a_key_is_refused_and_not_repeated(end):
    with refused("key-in-address", key="decision.server") as caught:
        server_address(f"http://host/v1{end}")
    assert SECRET not in str(caught.value)
    with refused("key-in-address", key="server") as caught:
        DecisionConfig(server=f"http://host/v1{end}").check()
    assert SECRET not in str(caught.value)

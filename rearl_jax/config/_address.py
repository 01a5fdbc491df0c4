"""Check for secrets in the address of a server, because logs and results contain the address."""

import re
from urllib.parse import urlsplit

from rearl_jax.problems import InvalidInputError, Problem

_SECRET = re.compile(r"key|token|secret|pass|auth|sig|cred|code", re.IGNORECASE)
"""Pattern in the names of address parameters that contain a secret."""


def check_no_secret(address: str, key: str) -> None:
    """Raise InvalidInputError, without the address, if it contains a password or a key.

    `key` is the configuration key whose value it is.
    """
    try:
        parts = urlsplit(address.strip())
    except ValueError:  # not an address; reported where it is used
        return
    remedy = "leave it out and put the key of the server into the environment variable that llm.api_key_env names"
    if "@" in parts.netloc:
        raise InvalidInputError(Problem("password-in-address", "holds a user name or password", remedy, key=key))
    # A part without "=" may itself be a key.
    pairs = [part.partition("=") for part in (*parts.query.split("&"), parts.fragment) if part]
    if any(_SECRET.search(name) or not equals for name, equals, _ in pairs):
        raise InvalidInputError(
            Problem("key-in-address", "holds a key or another secret after ? or #", remedy, key=key)
        )

"""The command that reads recordings, quoted for a shell."""

import re
import shlex
from collections.abc import Mapping

from rearl_jax.config.data import OF_FOREIGN_TABLES, DataConfig, OnBad

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./-]*")
_VALUES = frozenset({"null", "true", "false", "yes", "no", "on", "off", "y", "n", "nan", "inf"})
"""Words that are read as other values than texts unless they are quoted."""


def command_of(data: DataConfig) -> str:
    """The `rearl prepare` command for recordings in files, its words quoted for the shell."""
    words = ["rearl", "prepare", f"data={data.format.name}"]
    if data.root is not None:
        words.append(f"data.root={_quoted(data.root)}")
    for key in OF_FOREIGN_TABLES:
        if given := getattr(data, key):
            words.append(f"data.{key}={mapping_text(given)}")
    if data.ring is not None:
        words.append(f"data.ring={data.ring:.10g}")
    if data.on_bad is not OnBad.stop:
        words.append(f"data.on_bad={data.on_bad.name}")
    return shlex.join(words)


def mapping_text(given: Mapping[str, object]) -> str:
    """A mapping as a value of the command line."""
    pairs = (f"{name}: {'null' if value is None else _quoted(str(value))}" for name, value in given.items())
    return "{" + ", ".join(pairs) + "}"


def _quoted(text: str) -> str:
    """A text as a value of the command line, quoted so that it is read as the same text."""
    if _PLAIN.fullmatch(text) and text.lower() not in _VALUES:
        return text
    # Dollar signs would begin a reference to another key.
    text = re.sub(r"(\\*)\$\{", r"\1\1\\${", text)
    # Backslashes need escaping only before a quotation mark.
    return '"' + re.sub(r'(\\*)("|$)', lambda match: match[1] * 2 + ('\\"' if match[2] else ""), text) + '"'

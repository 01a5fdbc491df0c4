"""The command that reads recordings, quoted for a shell."""

import shlex
from collections.abc import Mapping

from rearl_jax.config.data import TABLE_KEYS, BadRows, DataConfig
from rearl_jax.config.quoting import quoted


def command_of(data: DataConfig) -> str:
    """The `rearl prepare` command for recordings in files, its words quoted for the shell."""
    words = ["rearl", "prepare", f"data={data.format.name}"]
    if data.root is not None:
        words.append(f"data.root={quoted(data.root)}")
    for key in TABLE_KEYS:
        if given := getattr(data, key):
            words.append(f"data.{key}={mapping_text(given)}")
    if data.ring is not None:
        words.append(f"data.ring={data.ring:.10g}")
    if data.on_bad is not BadRows.stop:
        words.append(f"data.on_bad={data.on_bad.name}")
    return shlex.join(words)


def mapping_text(given: Mapping[str, object]) -> str:
    """A mapping as a value of the command line."""
    pairs = (f"{name}: {'null' if value is None else quoted(str(value))}" for name, value in given.items())
    return "{" + ", ".join(pairs) + "}"

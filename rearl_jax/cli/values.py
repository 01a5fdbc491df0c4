"""Values of the command line, quoted so that Hydra reads each with the type of its key.

Hydra determines the type of a value from its spelling: `1e5` is a number even for a key of type string, `größe` cannot
be read at all, and neither can a quoted key within a mapping. Such values are quoted here, and quoted keys within
mappings are replaced by plain names, which `with_original_keys` turns back into the keys.
"""

import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from rearl_jax.config._schema import Key
from rearl_jax.config.quoting import quoted

_MARK = "rearl_word_"
"""Beginning of the name that stands for a quoted key; the rest is the word in hexadecimal digits."""

_STRINGS = re.compile(r"\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'", re.DOTALL)


def readable(overrides: list[str], keys: Mapping[str, Key]) -> list[str]:
    """The overrides, quoted so that Hydra reads values according to the types of their keys."""
    return [_readable(text, keys) for text in overrides]


def with_original_keys(record: Any) -> Any:
    """The record with the original keys of its mappings in place of the names that stand for them."""
    for item in fields(record):
        value = getattr(record, item.name)
        if is_dataclass(value):
            with_original_keys(value)
        elif isinstance(value, dict):
            object.__setattr__(record, item.name, {_original_key(key): part for key, part in value.items()})
    return record


def _readable(text: str, keys: Mapping[str, Key]) -> str:
    """One override `key=value`, quoted if its key takes texts or a mapping."""
    name, equals, value = text.partition("=")
    if not equals or name not in keys:
        return text
    kind = keys[name].type_name
    if kind == "dict":
        return f"{name}={_STRINGS.sub(_named_key, value)}"
    if not kind.startswith(("str", "[str")) or _STRINGS.search(value):
        return text
    if kind.startswith("str") and not _is_readable(value):
        # A comma separates several values, and a value that begins with a quotation mark is quoted already.
        return text if "," in value or value[:1] in ("'", '"') else f"{name}={quoted(value)}"
    parts = map(_as_text, re.split(r"([\[\],])", value))
    return f"{name}={''.join(parts)}"


def _named_key(match: re.Match[str]) -> str:
    """The quoted string; if it is a key of a mapping, the name that stands for it."""
    before, after = match.string[: match.start()].rstrip(), match.string[match.end() :].lstrip()
    if not (before.endswith(("{", ",")) and after.startswith(":")):
        return match[0]
    from omegaconf import OmegaConf

    # Through OmegaConf, which removes backslashes before `${`, the beginning of a reference to another key.
    word = OmegaConf.create({"word": _parsed(match[0]).value()}).word
    return _MARK + word.encode("utf-8", "surrogatepass").hex()


def _original_key(key: Any) -> Any:
    """The key that a name from `_named_key` stands for; any other key unchanged."""
    if not (isinstance(key, str) and re.fullmatch(rf"{_MARK}(?:[0-9a-f]{{2}})*", key)):
        return key
    return bytes.fromhex(key.removeprefix(_MARK)).decode("utf-8", "surrogatepass")


def _as_text(part: str) -> str:
    """A part of a value, quoted if Hydra would read it as a number or truth value and so change its spelling."""
    bare = part.strip()
    value = _parsed(bare).value() if bare and _is_readable(bare) else None
    is_changed = isinstance(value, bool | int | float) and str(value) != bare
    return part.replace(bare, f"'{bare}'") if is_changed else part


def _is_readable(value: str) -> bool:
    from hydra.errors import HydraException

    try:
        _parsed(value)
    except HydraException:
        return False
    return True


def _parsed(value: str) -> Any:
    """Hydra's parsed override with this value."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create().parse_override(f"key={value}")

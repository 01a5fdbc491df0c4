"""Texts in `key=value`, quoted so that Hydra's override grammar and OmegaConf read the same texts."""

import re

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./-]*")
_NOT_TEXT = frozenset({"null", "true", "false", "yes", "no", "on", "off", "y", "n", "nan", "inf"})
"""Words that Hydra or YAML reads as null, a truth value or a number unless they are quoted."""


def quoted(word: str) -> str:
    """A text as the value of a key of type string, or as a key or value within a mapping such as `data.classes={...}`.

    A number is read as a text too. For a shell, the caller quotes the whole `key=value` once more.
    """
    if _PLAIN.fullmatch(word) and word.lower() not in _NOT_TEXT:
        return word
    # OmegaConf would read ${ as the beginning of a reference to another key.
    word = re.sub(r"(\\*)\$\{", r"\1\1\\${", word)
    # Backslashes need escaping only before a quotation mark.
    return '"' + re.sub(r'(\\*)("|$)', lambda match: match[1] * 2 + ('\\"' if match[2] else ""), word) + '"'

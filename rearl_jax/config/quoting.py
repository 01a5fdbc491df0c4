"""Texts in `key=value`, quoted so that Hydra's override grammar and OmegaConf read the same texts."""

import re

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./-]*")
_SYNTAX = re.compile(r"""[,'"\\$\[\]{}]""")
"""Characters with a meaning in Hydra's override grammar or in OmegaConf."""

_NOT_TEXT = frozenset({"null", "true", "false", "yes", "no", "on", "off", "y", "n", "nan", "inf"})
"""Words that Hydra or YAML reads as null, a truth value or a number unless they are quoted."""


def quoted_if_needed(word: str) -> str:
    """A text as the value of a key of type string; in quotation marks only if it would be read as something else.

    Without them are also texts that the command line itself quotes, such as those with blanks.
    """
    is_needed = _SYNTAX.search(word) or word != word.strip() or word.lower() in _NOT_TEXT
    return quoted(word) if is_needed else word


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

"""Words as values of the command line, quoted so that they are read as the same words."""

import re

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./-]*")
_VALUES = frozenset({"null", "true", "false", "yes", "no", "on", "off", "y", "n", "nan", "inf"})
"""Words that are read as other values than texts unless they are quoted."""


def quoted(word: str) -> str:
    """A word as the value of a key with text, or as a key or value within a mapping such as `data.classes={...}`.

    The shell's own quotes come around the whole `key=value`. The result is a text also if the word looks like a number.
    """
    if _PLAIN.fullmatch(word) and word.lower() not in _VALUES:
        return word
    # Dollar signs would begin a reference to another key.
    word = re.sub(r"(\\*)\$\{", r"\1\1\\${", word)
    # Backslashes need escaping only before a quotation mark.
    return '"' + re.sub(r'(\\*)("|$)', lambda match: match[1] * 2 + ('\\"' if match[2] else ""), word) + '"'

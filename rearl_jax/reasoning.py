"""Reasoning in answers of language models, which never counts as an answer."""

import re

# Possessive quantifiers (*+) prevent backtracking, so each pattern passes over a text once.
_END = re.compile(r"</think(?:ing)?\s*+>", re.IGNORECASE)
_BEGIN = re.compile(r"<think(?:ing)?\s*+>", re.IGNORECASE)


def without_reasoning(text: str) -> str | None:
    """The text after the last reasoning block; None if a reasoning block is not closed.

    Everything up to the last `</think>` is reasoning, because some servers leave out the `<think>` before it.
    """
    start = 0
    for end in _END.finditer(text):
        start = end.end()
    return None if _BEGIN.search(text, start) else text[start:]

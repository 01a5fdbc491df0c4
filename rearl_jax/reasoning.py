"""Reasoning in answers of language models, which never counts as an answer."""

import re

# Possessive quantifiers (*+) prevent backtracking, so each pattern passes over a text once.
# Besides the tags of most models, [THINK] of Magistral and the channels of gpt-oss.
_END = re.compile(r"[<\[]/think(?:ing)?\s*+[>\]]|<\|channel\|>final\s*+<\|message\|>", re.IGNORECASE)
_BEGIN = re.compile(r"[<\[]think(?:ing)?\s*+[>\]]|<\|channel\|>analysis\s*+<\|message\|>", re.IGNORECASE)


def without_reasoning(text: str) -> str | None:
    """The text after the last reasoning block; None if a reasoning block is not closed.

    Everything up to the last `</think>` is reasoning, because some servers leave out the `<think>` before it.
    """
    start = 0
    for end in _END.finditer(text):
        start = end.end()
    return None if _BEGIN.search(text, start) else text[start:]

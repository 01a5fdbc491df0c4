"""Notices from a server's own count of tokens that it has cut prompts, which servers do in silence.

Ollama, for one, cuts what exceeds its context length, 4,096 tokens by default, and answers the rest.
"""

MOST_CHARACTERS = 8.0
"""Characters that a token holds at most, on average over a prompt [-]; own choice. English text has 4 to 5, the shipped
prompt with its many figures 2 to 4.
"""

_LEAST_PROMPTS = 8
"""Prompts with the same count that show a limit."""

_DIFFERENCE = 1.05
"""Longest prompt with a count relative to the shortest, above which a common count is no coincidence [-]."""


class PromptLengths:
    """Lengths and counted tokens of the prompts of one server."""

    def __init__(self) -> None:
        """No prompt was counted yet."""
        self._most = 0
        self._lengths: list[int] = []

    def is_cut(self, n_characters: int, n_tokens: int | None) -> bool:
        """Whether a prompt, with those before it, shows that the server cuts prompts.

        Either it has too few tokens for its length, or prompts of different lengths all have the largest count.

        Args:
            n_characters: Its length.
            n_tokens: Tokens that the server has counted; None or 0 if it does not say.
        """
        if not n_tokens:
            return False
        if n_tokens > self._most:
            self._most, self._lengths = n_tokens, []
        if n_tokens == self._most:
            self._lengths.append(n_characters)
        if n_characters > MOST_CHARACTERS * n_tokens:
            return True
        lengths = self._lengths
        return len(lengths) >= _LEAST_PROMPTS and max(lengths) > _DIFFERENCE * min(lengths)

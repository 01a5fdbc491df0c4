"""Detection of truncated prompts from the server's token counts, because servers truncate without a message.

For example, Ollama truncates a prompt to its context length, 4,096 tokens by default, and answers what is left.
"""

MAX_CHARACTERS_PER_TOKEN = 8.0
"""Largest plausible number of characters per token, averaged over a prompt [-]. English text has 4 to 5, the
shipped prompt with its many figures 2 to 4.
"""

_MIN_PROMPTS = 8
"""Number of prompts with the same token count that indicates a limit."""

_MAX_RATIO = 1.05
"""Ratio of the longest to the shortest prompt with equal counts [-] above which equality is not a coincidence."""


class PromptLengths:
    """Lengths and counted tokens of the prompts of one server."""

    def __init__(self) -> None:
        """Starts without prompts; `_lengths` will be those of the prompts with the largest token count."""
        self._largest_count = 0
        self._lengths: list[int] = []

    def is_cut(self, n_characters: int, n_tokens: int | None) -> bool:
        """Records a prompt; True if the prompts so far show that the server truncates them.

        Either this prompt has too few tokens for its length, or prompts of different lengths all have the largest
        count.

        Args:
            n_characters: Length of the prompt.
            n_tokens: Token count of the server; None or 0 if not stated.
        """
        if not n_tokens:
            return False
        if n_tokens > self._largest_count:
            self._largest_count, self._lengths = n_tokens, []
        if n_tokens == self._largest_count:
            self._lengths.append(n_characters)
        if n_characters > MAX_CHARACTERS_PER_TOKEN * n_tokens:
            return True
        lengths = self._lengths
        return len(lengths) >= _MIN_PROMPTS and max(lengths) > _MAX_RATIO * min(lengths)

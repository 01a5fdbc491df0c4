"""Keys of a summary held against what is said about them."""

import re


def check_documented(keys, meanings, **names):
    """Fails for a key that no pattern describes, and for a pattern that no key follows.

    Args:
        keys: Keys of the summary.
        meanings: Patterns with names in braces; those with one letter stand for numbers.
        names: What the other names stand for.
    """
    parts = {name: f"({'|'.join(values)})" for name, values in names.items()}
    patterns = [re.sub(r"\{(\w+)\}", lambda found: parts.get(found[1], r"\d+k?"), name) for name in meanings]
    undocumented = {key for key in keys if not any(re.fullmatch(f"{pattern}(_min|_max)?", key) for pattern in patterns)}
    assert undocumented == set()
    assert [pattern for pattern in patterns if not any(re.fullmatch(pattern, key) for key in keys)] == []

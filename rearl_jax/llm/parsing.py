"""Parsing of answers: finds the action in a text, or the reason why there is none, and the majority of several answers.

Every pattern passes over the text once, so the time is proportional to the length of the text.
"""

import json
import re
from collections import Counter, deque
from collections.abc import Sequence
from itertools import islice

from rearl_jax.core.meta_actions import MetaAction
from rearl_jax.decision.situation import ACTION_NAMES, N_ACTIONS
from rearl_jax.llm.records import NO_DECISION, Cause
from rearl_jax.reasoning import without_reasoning

_OTHER_NUMBER = N_ACTIONS
"""Value for every number that is not an identifier."""

_SPELLINGS = {"keep lane": int(MetaAction.IDLE)}
_SPELLINGS |= {action.name.lower().replace("_", " "): int(action) for action in MetaAction}
_SPELLINGS |= {word: action for action, word in enumerate(ACTION_NAMES)}
"""Identifiers of the actions by spelling, in lower case with spaces."""

# Possessive quantifiers (++) prevent backtracking, so each pattern passes over a text once. An underscore is not part
# of a word: _3_ is an emphasised 3.
_WORD_ENDS = r"(?![^\W_])"


def _whole_words(words: Sequence[str]) -> str:
    """Pattern of whole words of fixed length."""
    return "(?:" + "|".join(rf"{word}(?<![^\W_]{word})" for word in words) + ")"


_NAME = "|".join(sorted(_SPELLINGS, key=len, reverse=True)).replace(" ", "[ _-]")
# Neither part of a word nor of a decimal fraction.
_NUMBER = rf"[0-9](?<![^\W_][0-9])(?<![0-9][.,][0-9])[0-9]*+{_WORD_ENDS}(?![.,][0-9])"
_MARK = rf"{_whole_words(('action', 'answer', 'identifier', 'id'))}(?:_?id)?{_WORD_ENDS}"

# A word after the backquotes is the language of the fence, unless it is the answer.
_FENCE = re.compile(rf"```(?:(?!(?i:{_NAME})\b)[A-Za-z][\w+.-]*+(?=[ \t]*+\n))?")
_WHOLE = re.compile(rf"[\W_]*+(?:(?P<number>[0-9]++)|(?P<name>{_NAME}))[\W_]*+")
_KEYS = tuple(map(re.compile, ("action", "answer", r"\Aid(?:entifier)?\Z")))
_MARKED = re.compile(
    rf"(?:(?:{_MARK}|####(?!#))[^a-z0-9#]{{0,12}}(?P<name>{_NAME}){_WORD_ENDS}"
    rf"|(?:{_MARK}[^0-9]{{0,12}}|####(?!#)[^a-z0-9#]{{0,12}})(?P<number>{_NUMBER}))"
    # An action that is followed by another one is part of a list, not a choice.
    rf"(?![ \t]*+(?:[,/&|-]|or\b|and\b|to\b)?[ \t]*+(?:[0-9]|(?:{_NAME}){_WORD_ENDS}))"
)
_ALONE = re.compile(rf"(?P<number>{_NUMBER})")
# In running text only unambiguous spellings count, because of sentences such as "the car ahead is faster".
_SPELLED = [spelling for action in MetaAction for spelling in (action.name, action.name.lower())]
_IDENTIFIER = re.compile(
    rf"(?P<name>{_whole_words([name for name in _SPELLED if name.isupper() or '_' in name])}){_WORD_ENDS}"
)


def understand(text: str, choices: tuple[int, ...], finish: str = "") -> tuple[int, Cause]:
    """The chosen action (NO_DECISION for none) and the cause.

    Reasoning is left out (`without_reasoning`); if it does not end there is no answer. In the rest, without the marks
    of code fences, the first of these that applies counts:

    1. The whole text, apart from punctuation, is an identifier or a name of an action.
    2. It is a JSON object with such a value under a key about an action, else about an answer, else `id`.
    3. The last identifier or name that closely follows action, answer or id, or is the first thing after `####`.
    4. The only whole number in the text, or the only name in the spelling of `MetaAction`; if both, they must agree.

    Negations are not understood.

    Args:
        text: The answer.
        choices: Identifiers of the admissible actions.
        finish: Finish reason of the server; with `length`, a text without an answer was cut off.

    Source: the identifier after `####` is the format of DiLu's answers.
    """
    value = _value(text)
    if value is None:
        return NO_DECISION, Cause.truncated if finish == "length" else Cause.unparsable
    if value == _OTHER_NUMBER:
        return NO_DECISION, Cause.out_of_range
    return (value, Cause.answered) if value in choices else (NO_DECISION, Cause.inadmissible)


def majority(answers: Sequence[tuple[int, Cause]]) -> tuple[int, Cause]:
    """The action with more than half of all votes; invalid votes count in the total.

    Without such an action the result is NO_DECISION. Its cause is the most frequent cause of the invalid votes (the
    first of equally frequent ones) if more than half are invalid, else `disagreed`.
    """
    votes = Counter(action for action, cause in answers if cause is Cause.answered)
    causes = Counter(cause for _, cause in answers if cause is not Cause.answered)
    for action, n_votes in votes.most_common(1):
        if 2 * n_votes > len(answers):
            return action, Cause.answered
    if 2 * causes.total() > len(answers):
        return NO_DECISION, causes.most_common(1)[0][0]
    return NO_DECISION, Cause.disagreed


def _value(text: str) -> int | None:
    """Identifier that a text consists of; _OTHER_NUMBER for another number, None if there is none or several."""
    answer = without_reasoning(text)
    if answer is None:
        return None
    answer = _FENCE.sub(" ", answer).strip()
    whole = _WHOLE.fullmatch(answer.lower())
    if whole is not None:
        return _meaning(whole)
    for find in (_under_keys, _last_marked, _alone):
        identifiers = find(answer)
        if identifiers is not None:
            return identifiers.pop() if len(identifiers) == 1 else None
    return None


def _meaning(match: re.Match[str]) -> int:
    """Identifier of a match; _OTHER_NUMBER for a number that is not an identifier."""
    groups = match.groupdict()
    if (name := groups.get("name")) is not None:
        return _SPELLINGS[re.sub("[_-]", " ", name.lower())]
    number, start, text = groups["number"], match.start("number"), match.string
    # A dash after a word is a hyphen.
    is_negative = (
        text[max(start - 1, 0) : start] in ("-", "\u2212") and not text[max(start - 2, 0) : start - 1].isalnum()
    )
    return int(number) if len(number) == 1 and int(number) < N_ACTIONS and not is_negative else _OTHER_NUMBER


def _under_keys(text: str) -> set[int] | None:
    """Identifiers under the keys action, answer or id of a JSON object; None if the text is no such object."""
    if not text.startswith("{"):
        return None
    try:
        items = json.loads(text).items()
    except (ValueError, RecursionError):
        return None
    for pattern in _KEYS:
        values = [value for key, value in items if pattern.search(key.lower())]
        if values:
            wholes = (_WHOLE.fullmatch(str(value).lower()) for value in values if isinstance(value, (str, int)))
            return {_meaning(whole) for whole in wholes if whole is not None}
    return None


def _last_marked(text: str) -> set[int] | None:
    """The last identifier marked as the answer; None if there is none."""
    last = deque(_MARKED.finditer(text.lower()), maxlen=1)
    return {_meaning(match) for match in last} or None


def _alone(text: str) -> set[int]:
    """Identifiers of the only whole number and of the only name; empty if there are several numbers or names."""
    numbers, names = ([*islice(pattern.finditer(text), 2)] for pattern in (_ALONE, _IDENTIFIER))
    return set() if max(len(numbers), len(names)) > 1 else {_meaning(match) for match in (*numbers, *names)}

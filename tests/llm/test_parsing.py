"""Answers as models write them, and any text at all; the majority of votes."""

import json
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rearl_jax.core.meta_actions import MetaAction
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.llm.parsing import majority, understand
from rearl_jax.llm.records import NO_DECISION, Cause

ALL = (0, 1, 2, 3, 4)

ANSWERS = {
    0: ["LANE_LEFT", "lane_left", "Lane left.", "left", "Identifier: 0", '{"id": 0}'],
    1: ["IDLE", "keep", "Keep lane", "LANE_LEFT is not possible. Action: 1", "#### Step 2: decide\nAction: 1"]
    + ["I choose IDLE."],
    2: ["**right**", "Answer: **2**", 'Action: "LANE_RIGHT"', "```python3\n2\n```", '{"answer": 2, "id": 7}']
    + ["<h3>2</h3>"],
    3: ["3", " 3\n", "3.", "**3**", "_3_", "`3`", "(3)", "[3]", '"3"', "'3'", "- 3", "+3", "$3$"]
    + ["3\ufe0f\u20e3", "Faster!", "Action_id: 3", "ActionID=3", "action 3", "Action: faster", "Action-3"]
    + ["Action - 3", "Action 1 is safe, but 40 m are far. Final answer: 3"]
    + ["Action: 3\n1. because the gap is 40 m", "Action 3 because the gap is 20.5 m", "Response to user:#### 3"]
    + ["####3", "#### 3\n", "#### FASTER", "I choose 3", "\\boxed{3}", "3 (FASTER)", "3 = faster", "avoid 3"]
    + ["```\n3\n```", "```3```", "```text\n3\n```", "```faster\n```", '```json\n{"action": 3}\n```']
    + ['{"action": 3}', '{"action": "3"}', '{"Action_ID": "FASTER"}']
    + ['{"reason": "4 cars ahead, 2 behind", "action": 3}', '{"action_reason": "4 cars ahead", "action": 3}']
    + ['Here it is: {"action": 3}', '{"action": 3', "<answer>3</answer>", "<think>1 or 2? Action: 2</think>3"]
    + ["so it is 2</think>\n\n3", "<think>a</think>1<think>b</think>3", "<THINKING>2</THINKING >3"]
    + ["<think>\n\n</think>\n\n3", "[THINK]1 or 2?[/THINK]3"]
    + ["<|channel|>analysis<|message|>1 or 2?<|end|><|start|>assistant<|channel|>final<|message|>3<|return|>"],
    4: ["SLOWER", "The answer is 4.", "At 20.5 m/s I choose 4", "<p>4</p>"],
}
"""Texts by the action they choose: alone, after a word such as action, in prose, code and JSON, after reasoning."""

NOTHING = {
    Cause.unparsable: ["", " \n", "```", "```json\n```", "####", "I cannot decide.", "1. 1. 1.", "1 or 3", "0 1 3 4"]
    + ["Action: 1 or 3", "Action: left or right", "ACTIONS 0 1 3 4", "Actions: 0, 1", "3 SLOWER"]
    + ["LANE_LEFT is not possible, so 1", "FASTER or IDLE", "The car ahead is faster"]
    + ["You are right, keep the lane", "3.5", "3,5", "v3", "\uff13", "\u0663", "<think>3"]
    + ["<think>Action: 3 </thin", "3 <think> no, 4", "</think>", "<think>3</think>"]
    + ["[THINK]3", "<|channel|>analysis<|message|>3"]
    + ['{"action": null, "cars": "3 ahead"}', '{"action": [1, 3]}', '{"action": true}', '{"action": {"id": 3}}']
    + ['{"action": 1, "final_action": 3}', "{}", "[1, 3]", "<html><body>Error</body></html>"],
    Cause.out_of_range: ["5", "7", "34", "03", "-1", "\u22123", "Action: -1", "Option -3", "Action: 12", "9" * 5000]
    + ['{"action": 9}', '{"action": -1}', "<h1>502 Bad Gateway</h1>"],
}
"""Texts without an action, by cause."""


def by_text(texts):
    """Pairs of a text and its action or cause, from a table of texts by action or cause."""
    return [(text, meaning) for meaning, several in texts.items() for text in several]


@pytest.mark.parametrize(("text", "action"), by_text(ANSWERS))
def test_the_action_in_a_text(text, action):
    assert understand(text, ALL) == (action, Cause.answered)
    assert understand(text, tuple(other for other in ALL if other != action)) == (NO_DECISION, Cause.inadmissible)
    assert understand(text, ALL, "length") == (action, Cause.answered)


@pytest.mark.parametrize(("text", "cause"), by_text(NOTHING), ids=lambda value: str(value)[:40])
def test_texts_without_an_answer(text, cause):
    assert understand(text, ALL, "stop") == (NO_DECISION, cause)
    cut = Cause.truncated if cause is Cause.unparsable else cause
    assert understand(text, ALL, "length") == (NO_DECISION, cut)


def test_every_name_and_number_of_an_action_is_understood():
    assert len(ACTION_NAMES) == len(MetaAction)
    for action, word in zip(MetaAction, ACTION_NAMES, strict=True):
        for text in (word, action.name, str(int(action)), f"Action: {word}", f"I choose {action.name}"):
            assert understand(text, ALL) == (action, Cause.answered)


# Texts made of pieces that the rules look for reach their special cases; texts of random characters hardly do.
PIECES = st.sampled_from(
    [*"01234579-.,:;*_`#{}[]()<>/|& \n\t\"'", "####", "```", "```json\n", "action", "Action_id", "answer", "id", "not "]
    + ["<think>", "</think>", "</thinking >", "LANE_LEFT", "lane left", "IDLE", "keep", "FASTER", "or", "to", "x", "é"]
    + ['{"action": ', '"}', "null", "3.5", "12", "\u2212", "\u0130", "\ud800", "\x00"]
)
TEXTS = st.one_of(st.text(), st.lists(PIECES, max_size=14).map("".join))
CHOICES = st.sets(st.sampled_from(ALL), min_size=1).map(lambda chosen: tuple(sorted(chosen)))
FINISHES = st.sampled_from(["", "stop", "length", "content_filter"])
CAUSES = {Cause.answered, Cause.unparsable, Cause.out_of_range, Cause.inadmissible, Cause.truncated}


@given(TEXTS, CHOICES, FINISHES)
@settings(max_examples=500, deadline=None)
def test_any_text_gives_an_admissible_action_or_the_reason_why_not(text, choices, finish):
    action, cause = understand(text, choices, finish)
    assert cause in CAUSES
    assert action in choices if cause is Cause.answered else action == NO_DECISION
    assert cause is not Cause.truncated or finish == "length"


@given(TEXTS, st.text(" \n\t\r\u00a0\u2003"), st.text(" \n\t\r\u00a0\u2003"))
@settings(max_examples=500, deadline=None)
def test_white_space_around_a_text_does_not_change_the_result(text, before, after):
    assert understand(before + text + after, ALL) == understand(text, ALL)


@given(TEXTS, TEXTS, st.sampled_from(["<think>", "", "<thinking>"]))
@settings(max_examples=500, deadline=None)
def test_reasoning_does_not_change_the_result(thought, rest, start):
    assert understand(start + thought + "</think>" + rest, ALL) == understand(rest, ALL)


@given(TEXTS)
@settings(max_examples=200, deadline=None)
def test_an_open_reasoning_block_contains_no_answer(thought):
    if "</think" not in thought:
        assert understand("<think>" + thought, ALL) == (NO_DECISION, Cause.unparsable)


@given(st.dictionaries(st.text(max_size=8), st.one_of(st.integers(), st.text(), st.none()), max_size=4))
@settings(max_examples=200, deadline=None)
def test_the_key_action_of_a_json_object_determines_the_action(others):
    others = {key: value for key, value in others.items() if "action" not in key.lower()}
    assert understand(json.dumps({**others, "action": 3}), ALL) == (3, Cause.answered)


HUGE = {
    "prose": "the gap is 12.5 m and the car ahead is faster; " * 21_000,
    "digits": "9" * 10**6,
    "decimals": "1.5" * 333_333,
    "numbers": "1 " * 500_000,
    "words": "a" * 10**6,
    "marks": "action " * 143_000,
    "marked": "id:1," * 200_000,
    "lists": "answer 1 or 2;" * 71_000,
    "names": "LANE_LEFT " * 100_000,
    "fences": "```" * 333_333,
    "fence word": "```" + "a" * 10**6,
    "hashes": "#" * 10**6,
    "thoughts": "</think>" * 125_000,
    "open thoughts": "<think" + " " * 10**6,
    "brackets": "[" * 10**6,
    "braces": '{"a":' * 200_000,
    "dots": "3" + "." * 10**6 + "x",
    "dashes": "-" * 10**6,
    "spaces": "action 3" + " " * 10**6 + "x",
    "repeated marks before digits": "id id id id id " + "9" * 10**6 + "x",
}


@pytest.mark.parametrize("name", HUGE)
def test_a_million_characters_are_parsed_in_less_than_two_seconds(name):
    """Patterns of quadratic cost would take hours; the bound leaves room for a busy machine."""
    start = time.process_time()
    understand(HUGE[name], ALL)
    assert time.process_time() - start < 2


def answered(*actions):
    return [(action, Cause.answered) for action in actions]


def failed(*causes):
    return [(NO_DECISION, cause) for cause in causes]


@pytest.mark.parametrize(
    ("votes", "expected"),
    [
        (answered(3), (3, Cause.answered)),
        (failed(Cause.late), (NO_DECISION, Cause.late)),
        (answered(3, 3, 1), (3, Cause.answered)),
        (answered(1, 3, 3), (3, Cause.answered)),
        (answered(0, 0, 0), (0, Cause.answered)),
        (answered(0, 1, 2), (NO_DECISION, Cause.disagreed)),
        (answered(3, 3) + failed(Cause.failed), (3, Cause.answered)),
        (answered(3, 1) + failed(Cause.failed), (NO_DECISION, Cause.disagreed)),
        (answered(3) + failed(Cause.late, Cause.failed), (NO_DECISION, Cause.late)),
        (answered(3) + failed(Cause.inadmissible, Cause.inadmissible), (NO_DECISION, Cause.inadmissible)),
        (failed(Cause.late, Cause.broken, Cause.broken), (NO_DECISION, Cause.broken)),
        (failed(Cause.broken, Cause.late, Cause.truncated), (NO_DECISION, Cause.broken)),
    ],
)
def test_majority_of_votes(votes, expected):
    assert majority(votes) == expected

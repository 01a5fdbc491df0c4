"""Answers as models write them, and any text at all; the majority of votes."""

import json
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rearl_jax.core.meta_actions import MetaAction
from rearl_jax.llm.parsing import WORDS, majority, understand
from rearl_jax.llm.records import KEEP_OUT, Cause

ALL = (0, 1, 2, 3, 4)

ANSWERS = {
    # The whole text.
    "3": 3,
    " 3\n": 3,
    "3.": 3,
    "**3**": 3,
    "_3_": 3,
    "`3`": 3,
    "(3)": 3,
    "[3]": 3,
    '"3"': 3,
    "'3'": 3,
    "- 3": 3,
    "+3": 3,
    "$3$": 3,
    "3\ufe0f\u20e3": 3,
    "LANE_LEFT": 0,
    "lane_left": 0,
    "Lane left.": 0,
    "left": 0,
    "IDLE": 1,
    "keep": 1,
    "Keep lane": 1,
    "**right**": 2,
    "Faster!": 3,
    "SLOWER": 4,
    # Beside a word that says what it is.
    "Action_id: 3": 3,
    "ActionID=3": 3,
    "action 3": 3,
    "Answer: **2**": 2,
    "The answer is 4.": 4,
    "Identifier: 0": 0,
    "Action: faster": 3,
    'Action: "LANE_RIGHT"': 2,
    "Action-3": 3,
    "Action - 3": 3,
    "Action 1 is safe, but 40 m are far. Final answer: 3": 3,
    "LANE_LEFT is not possible. Action: 1": 1,
    "Action: 3\n1. because the gap is 40 m": 3,
    "Action 3 because the gap is 20.5 m": 3,
    "Response to user:#### 3": 3,
    "####3": 3,
    "#### 3\n": 3,
    "#### FASTER": 3,
    "#### Step 2: decide\nAction: 1": 1,
    # The only number or name.
    "I choose 3": 3,
    "I choose IDLE.": 1,
    "\\boxed{3}": 3,
    "3 (FASTER)": 3,
    "3 = faster": 3,
    "At 20.5 m/s I choose 4": 4,
    "avoid 3": 3,
    # Code, JSON, HTML.
    "```\n3\n```": 3,
    "```3```": 3,
    "```text\n3\n```": 3,
    "```faster\n```": 3,
    '```json\n{"action": 3}\n```': 3,
    "```python3\n2\n```": 2,
    '{"action": 3}': 3,
    '{"action": "3"}': 3,
    '{"Action_ID": "FASTER"}': 3,
    '{"answer": 2, "id": 7}': 2,
    '{"id": 0}': 0,
    '{"reason": "4 cars ahead, 2 behind", "action": 3}': 3,
    '{"action_reason": "4 cars ahead", "action": 3}': 3,
    'Here it is: {"action": 3}': 3,
    '{"action": 3': 3,
    "<answer>3</answer>": 3,
    "<h3>2</h3>": 2,
    "<p>4</p>": 4,
    # Thoughts left out.
    "<think>1 or 2? Action: 2</think>3": 3,
    "so it is 2</think>\n\n3": 3,
    "<think>a</think>1<think>b</think>3": 3,
    "<THINKING>2</THINKING >3": 3,
    "<think>\n\n</think>\n\n3": 3,
}

NOTHING = {
    "": Cause.unparsable,
    " \n": Cause.unparsable,
    "```": Cause.unparsable,
    "```json\n```": Cause.unparsable,
    "####": Cause.unparsable,
    "I cannot decide.": Cause.unparsable,
    "1. 1. 1.": Cause.unparsable,
    "1 or 3": Cause.unparsable,
    "0 1 3 4": Cause.unparsable,
    "Action: 1 or 3": Cause.unparsable,
    "Action: left or right": Cause.unparsable,
    "ACTIONS 0 1 3 4": Cause.unparsable,
    "Actions: 0, 1": Cause.unparsable,
    "3 SLOWER": Cause.unparsable,
    "LANE_LEFT is not possible, so 1": Cause.unparsable,
    "FASTER or IDLE": Cause.unparsable,
    "The car ahead is faster": Cause.unparsable,
    "You are right, keep the lane": Cause.unparsable,
    "3.5": Cause.unparsable,
    "3,5": Cause.unparsable,
    "v3": Cause.unparsable,
    "\uff13": Cause.unparsable,
    "\u0663": Cause.unparsable,
    "<think>3": Cause.unparsable,
    "<think>Action: 3 </thin": Cause.unparsable,
    "3 <think> no, 4": Cause.unparsable,
    "</think>": Cause.unparsable,
    "<think>3</think>": Cause.unparsable,
    '{"action": null, "cars": "3 ahead"}': Cause.unparsable,
    '{"action": [1, 3]}': Cause.unparsable,
    '{"action": true}': Cause.unparsable,
    '{"action": {"id": 3}}': Cause.unparsable,
    '{"action": 1, "final_action": 3}': Cause.unparsable,
    "{}": Cause.unparsable,
    "[1, 3]": Cause.unparsable,
    "<html><body>Error</body></html>": Cause.unparsable,
    "5": Cause.out_of_range,
    "7": Cause.out_of_range,
    "34": Cause.out_of_range,
    "03": Cause.out_of_range,
    "-1": Cause.out_of_range,
    "\u22123": Cause.out_of_range,
    "Action: -1": Cause.out_of_range,
    "Option -3": Cause.out_of_range,
    "Action: 12": Cause.out_of_range,
    "9" * 5000: Cause.out_of_range,
    '{"action": 9}': Cause.out_of_range,
    '{"action": -1}': Cause.out_of_range,
    "<h1>502 Bad Gateway</h1>": Cause.out_of_range,
}


@pytest.mark.parametrize("text", ANSWERS)
def test_answers(text):
    assert understand(text, ALL) == (ANSWERS[text], Cause.answered)
    without = tuple(action for action in ALL if action != ANSWERS[text])
    assert understand(text, without) == (KEEP_OUT, Cause.inadmissible)
    assert understand(text, ALL, "length") == (ANSWERS[text], Cause.answered)


@pytest.mark.parametrize("text", NOTHING, ids=lambda text: text[:40])
def test_texts_without_an_answer(text):
    assert understand(text, ALL, "stop") == (KEEP_OUT, NOTHING[text])
    cut = Cause.truncated if NOTHING[text] is Cause.unparsable else NOTHING[text]
    assert understand(text, ALL, "length") == (KEEP_OUT, cut)


def test_words_are_those_of_the_actions():
    assert len(WORDS) == len(MetaAction)
    for action, word in zip(MetaAction, WORDS, strict=True):
        for text in (word, action.name, str(int(action)), f"Action: {word}", f"I choose {action.name}"):
            assert understand(text, ALL) == (action, Cause.answered)


# Texts made of what the rules look for come upon their corners; texts of any characters hardly do.
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
    assert action in choices if cause is Cause.answered else action == KEEP_OUT
    assert cause is not Cause.truncated or finish == "length"


@given(TEXTS, st.text(" \n\t\r\u00a0\u2003"), st.text(" \n\t\r\u00a0\u2003"))
@settings(max_examples=500, deadline=None)
def test_white_space_around_means_nothing(text, before, after):
    assert understand(before + text + after, ALL) == understand(text, ALL)


@given(TEXTS, TEXTS, st.sampled_from(["<think>", "", "<thinking>"]))
@settings(max_examples=500, deadline=None)
def test_thoughts_mean_nothing(thought, rest, start):
    assert understand(start + thought + "</think>" + rest, ALL) == understand(rest, ALL)


@given(TEXTS)
@settings(max_examples=200, deadline=None)
def test_an_open_thought_holds_no_answer(thought):
    if "</think" not in thought:
        assert understand("<think>" + thought, ALL) == (KEEP_OUT, Cause.unparsable)


@given(st.dictionaries(st.text(max_size=8), st.one_of(st.integers(), st.text(), st.none()), max_size=4))
@settings(max_examples=200, deadline=None)
def test_json_with_an_action_says_what_its_action_is(others):
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
def test_a_million_characters_cost_their_length(name):
    """Quadratic patterns take hours for them; the bound leaves room for a busy machine."""
    start = time.process_time()
    understand(HUGE[name], ALL)
    assert time.process_time() - start < 2


def answered(*actions):
    return [(action, Cause.answered) for action in actions]


def failed(*causes):
    return [(KEEP_OUT, cause) for cause in causes]


@pytest.mark.parametrize(
    ("votes", "expected"),
    [
        (answered(3), (3, Cause.answered)),
        (failed(Cause.late), (KEEP_OUT, Cause.late)),
        (answered(3, 3, 1), (3, Cause.answered)),
        (answered(1, 3, 3), (3, Cause.answered)),
        (answered(0, 0, 0), (0, Cause.answered)),
        (answered(0, 1, 2), (KEEP_OUT, Cause.disagreed)),
        (answered(3, 3) + failed(Cause.failed), (3, Cause.answered)),
        (answered(3, 1) + failed(Cause.failed), (KEEP_OUT, Cause.disagreed)),
        (answered(3) + failed(Cause.late, Cause.failed), (KEEP_OUT, Cause.late)),
        (answered(3) + failed(Cause.inadmissible, Cause.inadmissible), (KEEP_OUT, Cause.inadmissible)),
        (failed(Cause.late, Cause.broken, Cause.broken), (KEEP_OUT, Cause.broken)),
        (failed(Cause.broken, Cause.late, Cause.truncated), (KEEP_OUT, Cause.broken)),
    ],
)
def test_majority(votes, expected):
    assert majority(votes) == expected

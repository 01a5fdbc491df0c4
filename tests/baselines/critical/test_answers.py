"""The meaning of a language model's text."""

import pytest

from rearl_jax.baselines.critical.answers import BadAnswerError, read_mixture
from rearl_jax.baselines.critical.mixture import Mixture

GOOD = '{"aggressive": 0.1, "defensive": 0.25, "truck": 0.15}'


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        f"Here it is:\n```json\n{GOOD}\n```\nGood luck!",
        f'<think>perhaps {{"aggressive": 0.9}}?</think>{GOOD}',
        f'<Thinking>perhaps {{"aggressive": 0.9}}?</Thinking>{GOOD}',
        '{"aggressive": 1e-1, "defensive": 0.25, "truck": 0.15, "why": {"because": "{nested}"}}',
    ],
)
def test_the_object_between_the_outer_braces_is_read(text):
    assert read_mixture(text) == Mixture(0.1, 0.25, 0.15)


def test_the_ends_of_the_ranges_are_good():
    for shares in ((0, 0, 0), (1, 0, 0), (0.7, 0.2, 0.1), (0.1, 0.2, 0.7)):
        text = '{{"aggressive": {}, "defensive": {}, "truck": {}}}'.format(*shares)
        assert read_mixture(text) == shares


@pytest.mark.parametrize(
    ("text", "fault", "said"),
    [
        ("", "unparsable", "no JSON object"),
        ("More trucks, please.", "unparsable", "no JSON object"),
        ("} nothing {", "unparsable", "no JSON object"),
        (f"<think>perhaps {GOOD}, but", "unparsable", "reasoning does not end"),
        (f"<think>perhaps</think>{GOOD}<think>", "unparsable", "reasoning does not end"),
        ("{aggressive: 0.1}", "unparsable", "not JSON"),
        (f"{GOOD} or {GOOD}", "unparsable", "not JSON"),
        ("{" * 100_000 + "}" * 100_000, "unparsable", "not JSON"),
        ('{"aggressive": 0.1, "defensive": 0.2}', "unparsable", "no number for 'truck'"),
        (f'{{"config": {GOOD}}}', "unparsable", "no number for 'aggressive'"),
        ('{"aggressive": "0.1", "defensive": 0.2, "truck": 0}', "unparsable", "no number for 'aggressive'"),
        ('{"aggressive": true, "defensive": 0.2, "truck": 0}', "unparsable", "no number for 'aggressive'"),
        ('{"aggressive": 10, "defensive": 20, "truck": 0}', "out_of_range", "10 is not within 0 and 1"),
        ('{"aggressive": -0.1, "defensive": 0.2, "truck": 0}', "out_of_range", "-0.1 is not within"),
        ('{"aggressive": NaN, "defensive": 0.2, "truck": 0}', "out_of_range", "nan is not within"),
        ('{"aggressive": 1%s, "defensive": 0, "truck": 0}' % ("0" * 400), "out_of_range", "far outside"),
        ('{"aggressive": 0.5, "defensive": 0.4, "truck": 0.2}', "out_of_range", "their sum is 1.1"),
    ],
)
def test_everything_else_is_refused_with_a_reason(text, fault, said):
    with pytest.raises(BadAnswerError, match=said) as caught:
        read_mixture(text)
    assert caught.value.fault.name == fault

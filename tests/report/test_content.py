"""What any report says: figures as text, and sentences only where there is something to say."""

import pytest

from rearl_jax.report.content import number


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0.0, "0"),
        (0.12345, "0.123"),
        (99.96, "100"),
        (999.4, "999"),
        (999.6, "1,000"),
        (12345.6, "12,346"),
        (-999.6, "-1,000"),
        (12345, "12,345"),
        (float("nan"), "-"),
        (None, "-"),
        (True, "yes"),
    ],
)
def test_figures_have_three_digits_and_no_exponent(value, said):
    assert number(value) == said

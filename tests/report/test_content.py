"""What any report says: figures as text, and sentences only where there is something to say."""

import pandas as pd
import pytest

from rearl_jax.report.content import number
from rearl_jax.report.others import _closer


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


def test_nothing_is_said_of_rows_beside_base_where_there_are_none():
    columns = {"metric": "h", "less_base_low": [None], "less_base_high": [None]}
    assert _closer(pd.DataFrame(columns)) == ""
    rows = pd.DataFrame({"metric": "h", "less_base_low": [-0.2, -0.1], "less_base_high": [-0.1, 0.1]})
    assert _closer(rows).startswith("By the Hellinger distance of speeds, 1 of 2 rows are closer")

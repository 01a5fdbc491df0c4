"""A document in the terminal and as a page."""

import re

import pandas as pd
import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.config.driver import record_of
from rearl_jax.document.document import Document, Section
from rearl_jax.document.html import command, page_of
from rearl_jax.document.table import Alignment, Cell, Emphasis, Row, Table, interval, number, table_of
from rearl_jax.document.terminal import GENERATED, text_of

_ROWS = (
    Row("ours [new]", (Cell("0.123", "0.100 to 0.150"), Cell("closer")), Emphasis.strong),
    Row("paper", (Cell("0.2"), Cell("-")), Emphasis.subdued),
)
TABLE = Table("Errors & <others>", ("H [-]", "verdict"), _ROWS)
HIDDEN = Table(
    "Definitions", ("meaning",), (Row("H", (Cell("Hellinger distance of the speeds of a window of 10 s"),)),)
)


def document(*, generated: bool = False) -> Document:
    return Document(
        title="A study",
        verdict="Ours is closer.",
        sections=(
            Section("Errors", ("Smaller is closer.",), (TABLE,), ("a note",)),
            Section("Definitions", tables=(HIDDEN,), is_folded=True),
        ),
        command="evaluate method=base",
        generated=generated,
        captions={"second": "The second figure.", "first": "The first figure."},
    )


def test_the_terminal_shows_verdict_tables_and_notes_and_leaves_folded_sections_out():
    text = text_of(document())
    places = [text.index(part) for part in ("Ours is closer.", "Errors & <others>", "ours [new]", "Smaller", "a note")]
    assert places == sorted(places)
    assert "0.100 to 0.150" in text
    assert "Definitions" not in text
    assert GENERATED not in text


def test_generated_recordings_are_said_in_the_terminal_and_on_the_page():
    generated = document(generated=True)
    assert GENERATED in text_of(generated)
    assert "Generated recordings" in page_of(generated, EvaluateTask(), {})
    assert "Generated recordings" not in page_of(document(), EvaluateTask(), {})


def test_a_page_shows_sections_then_figures_then_what_is_folded_and_escapes_text():
    page = page_of(document(), EvaluateTask(), {"first": b"1", "second": b"2", "another": b"3"})
    parts = (
        "Ours is closer.",
        "Errors &amp; &lt;others&gt;",
        "second figure",
        "first figure",
        ">another<",
        "<summary>Definitions",
    )
    places = [page.index(part) for part in parts]
    assert places == sorted(places)
    assert not re.search(r'(?:src|href)="(?!data:)', page)


def test_columns_are_aligned_by_what_they_hold():
    assert [TABLE.alignment(column) for column in (0, 1)] == [Alignment.number, Alignment.words]
    assert HIDDEN.alignment(0) is Alignment.text


def test_a_row_with_a_cell_too_few_is_refused():
    with pytest.raises(ValueError, match="ours"):
        Table("Errors", ("H", "MAPE"), (Row("ours", (Cell("1"),)),))


def test_the_table_of_a_frame_takes_ends_as_intervals_and_says_what_it_leaves_out():
    frame = pd.DataFrame({"name": [f"row {n}" for n in range(70)], "h": 0.5, "h_low": 0.4, "h_high": 0.6})
    table = table_of("Errors", frame, {"name": "", "h": "H [-]", "absent": "nothing"})
    assert table.headings == ("H [-]",)
    assert table.rows[0] == Row("row 0", (Cell("0.500", "0.400 to 0.600"),))
    assert (len(table.rows), table.title) == (60, "Errors (the first 60 of 70 rows)")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.12345, "0.123"),
        (99.96, "100"),
        (999.4, "999"),
        (-999.6, "-1,000"),
        (1234.5, "1,234"),
        (1234, "1,234"),
        (0.0, "0"),
        (True, "yes"),
        (float("nan"), "-"),
        (None, "-"),
    ],
)
def test_numbers_as_text(value, text):
    assert number(value) == text


def test_an_interval_without_an_end_is_none():
    assert (interval(1.0, None), interval(-0.5, 0.25, "+")) == ("", "-0.500 to +0.250")


def test_both_bounds_have_the_decimals_of_the_larger_one():
    assert interval(-0.0608, 0.00135, "+") == "-0.0608 to +0.0014"
    assert interval(0.0234, 5.05) == "0.02 to 5.05"
    assert interval(-0.0001, 0.5) == "0.000 to 0.500"


def test_a_caption_does_not_repeat_the_heading_of_its_section():
    page = page_of(document(), EvaluateTask(), {})
    assert "<caption><span>Errors &amp; &lt;others&gt;</span></caption>" in page
    assert page.count('aria-label="Definitions"') == 1
    assert "<caption><span>Definitions" not in page


def test_the_command_says_what_differs_from_the_defaults():
    assert command("evaluate method=base", EvaluateTask(study="a b")) == "rearl evaluate method=base 'study=a b'"
    driven = EvaluateTask(driver=record_of("gipps")(time_gap_sd=0.3))
    assert command("evaluate", driven) == "rearl evaluate driver=gipps driver.time_gap_sd=0.3"

"""The document of a blind study: its rates, what was said, and what must be known about it."""

import pandas as pd
import pytest

from rearl_jax.blind.document import document_of
from rearl_jax.document.terminal import text_of
from tests.blind.made_tables import PROTOCOL, SUMMARY, TABLES


@pytest.fixture(scope="module")
def document():
    return document_of(SUMMARY, TABLES, PROTOCOL)


def cells(document, title):
    """Cells of a table of the document, row by row."""
    (table,) = [table for section in document.sections for table in section.tables if table.title == title]
    return [(row.title, *((cell.value, cell.interval) for cell in row.cells)) for row in table.rows]


def test_rates_and_outcomes_stand_beside_their_intervals(document):
    assert document.verdict.startswith("Discovery was right about 2 of 3 data sets")
    ends = "9.0 % to 99.0 %"
    rates = [("effects named", ("2 of 3", ""), ("66.7 %", ends), ("≥ 95 %", ""), ("missed", ""))]
    assert cells(document, "Rates with exact 95 % intervals") == rates
    # Only outcomes that occur have a column.
    outcomes = [("named", ("3", ""), ("2", ""), ("1", ""), ("1", ""), ("33.3 %", ends))]
    assert cells(document, "Outcomes by set") == outcomes
    (claims,) = cells(document, "Names by the confidence stated with them, and how many of them are there")
    assert claims == ("80.0 % to 90.0 %", ("3", ""), ("85.0 %", ""), ("66.7 %", ends))


def test_what_was_said_is_listed_by_what_was_hidden(document):
    said = [(title, word, n) for title, (word, _), (n, _) in cells(document, "What was said, by what was hidden")]
    assert said == [("grade", "grade", "1"), ("bend", "grade", "1"), ("bend", "nothing", "1")]


def test_notes_say_how_it_was_sealed_and_what_was_not_counted_again(document):
    text = " ".join(text_of(document).split())
    parts = (
        "Code c0de, then master seed 7 (drawn), then truth sealed as abababababababab.",
        "3 of 5 data sets, the first in the study's random order.",
        "recover 90.0 % of the reduction of the squared error that the hidden effect itself brings, in 2 data sets.",
        "Intervals of parameters that hold the truth: 1 of 2.",
        "Median time of a verdict: 1.5 s.",
        "Counted when the study was run, as cases.parquet has no ends of intervals: ",
    )
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "How it was kept blind" not in text
    assert "drawn, then what is hidden" in document.sections[-1].paragraphs[0]


def test_tables_without_rows_are_left_out():
    nothing = {"parameters": pd.DataFrame(), "calibration": pd.DataFrame()}
    summary = SUMMARY | {"oracle_share": None, "median_seconds": None, "n_drawn": 3}
    document = document_of(summary, TABLES | nothing, PROTOCOL | {"seed_drawn": False})
    titles = [section.title for section in document.sections]
    assert titles == ["Rates", "Outcomes by set", "What was said to what", "Data sets", "How it was kept blind"]
    assert "(given)" in document.sections[0].notes[0]
    assert not any("squared error" in note or "Median" in note for note in document.sections[0].notes)

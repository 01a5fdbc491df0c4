"""The document of a blind study: its rates, what was said, and what must be known about it."""

import pandas as pd

from rearl_jax.blind.document import document_of
from rearl_jax.document.terminal import text_of
from tests.blind.made_tables import PROTOCOL, SUMMARY, TABLES


def test_the_terminal_shows_rates_with_intervals_what_was_said_and_how_it_was_sealed():
    text = " ".join(text_of(document_of(SUMMARY, TABLES, PROTOCOL)).split())
    parts = (
        "Discovery was right about 2 of 3 data sets",
        "effects named 2 3 66.7 ≥ 95 % no 9.0 to 99.0",
        "Code c0de, then master seed 7 (drawn), then truth sealed as abababababababab.",
        "3 of 5 data sets, the first in the study's random order.",
        "achieve 90.0 % of the largest possible reduction of the",
        "Intervals of parameters that contain the truth: 1 of 2.",
        "Median time of a verdict: 1.5 s.",
        "Not counted again but kept as first counted, as cases.parquet has no ends of intervals: ",
        "data sets right wrong with a false effect share [%]",  # only outcomes that occur have a column
        "named 3 2 1 1 33.3 9.0 to 99.0",
        "grade grade 1 bend grade 1 bend nothing 1",
        "80.0 % to 90.0 % 3 85.0 66.7 9.0 to 99.0",
    )
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "How it was kept blind" not in text


def test_what_there_are_no_figures_for_is_left_out():
    nothing = {"parameters": pd.DataFrame(), "calibration": pd.DataFrame()}
    summary = SUMMARY | {"oracle_share": None, "median_seconds": None, "n_drawn": 3}
    sections = document_of(summary, TABLES | nothing, PROTOCOL | {"seed_drawn": False}).sections
    assert len(sections) == 5
    assert not any("squared error" in note or "Median" in note for note in sections[0].notes)
    assert "seed was given" in sections[-1].paragraphs[0]

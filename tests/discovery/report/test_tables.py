"""Tables of a discovery that are read again."""

import pytest

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.report.tables import null_table, read_null
from rearl_jax.discovery.search.null import Null


def test_a_null_survives_a_file(tmp_path):
    terms = (Term("grade"), Term("dependence", "gap"), Term("time_gap_dependence", "gap"), Term("clock_offset"))
    null = Null(dict(zip(terms, (1.0, 2.0, 3.0, 4.0), strict=True)), dict.fromkeys(terms, 0.5), 7)
    table = null_table(null)
    assert list(table["candidate"]) == ["grade", "dependence.gap", "time_gap_dependence.gap", "clock_offset"]
    table.to_parquet(tmp_path / "null.parquet")
    assert read_null(tmp_path / "null.parquet") == null


@pytest.mark.parametrize("text", ["grade", "dependence.gap"])
def test_a_term_is_read_as_it_is_written(text):
    assert str(Term.read(text)) == text
    assert Term.read(text).is_effect == (text == "grade")

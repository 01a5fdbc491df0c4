"""A data set of the small blind study, end to end with the real discovery: minutes, mostly compiling."""

import json

import pytest

pytestmark = pytest.mark.slow


def test_a_small_study_names_what_is_hidden(run_blind, tmp_path):
    summary = run_blind(tmp_path, "small", "blind.seed=3", "blind.sets=named*", "blind.first=1")
    assert (summary["n_cases"], summary["n_right"]) == (1, 1)
    assert summary["n_wrong"] == summary["n_failed"] == 0
    assert summary["n_false"] <= 1  # a doubtful name, in addition to a right one
    (path,) = (tmp_path / "small" / "verdicts").glob("*.json")
    assert "verdict" in json.loads(path.read_text())

"""The small blind study, end to end with the real discovery: a few minutes, most of them compiling."""

import pytest

pytestmark = pytest.mark.slow

CHOSEN = "blind.seed=3", "blind.sets=[cn][oa]*", "blind.first=2"
"""A control and a named effect of the six data sets of this seed."""


@pytest.fixture(scope="module")
def summary(run_blind, tmp_path_factory):
    """The summary of two of its six data sets, as a user gets it."""
    return run_blind(tmp_path_factory.mktemp("blind"), "small", *CHOSEN)


def test_small_study_finds_what_is_hidden(summary):
    assert summary["n_cases"] == 2
    assert summary["n_right"] == 2
    assert summary["n_wrong"] == summary["n_failed"] == 0
    assert summary["n_false"] <= 1  # a doubtful name, in addition to a right one
    hits = {score["name"]: score["hits"] for score in summary["scores"]}
    assert hits["control_false"] == 0

"""The small blind study, end to end with the real discovery: a few minutes, most of them compiling."""

import pytest

pytestmark = pytest.mark.slow

SEED = 3
"""A seed with which a control, an effect and an artefact are the first three data sets."""


@pytest.fixture(scope="module")
def summary(run_blind, tmp_path_factory):
    """The summary of the first three of its six data sets, as a user gets it."""
    return run_blind(tmp_path_factory.mktemp("blind"), "small", f"blind.seed={SEED}", "blind.first=3")


def test_small_study_finds_what_is_hidden(summary):
    assert summary["n_cases"] == 3
    assert summary["n_right"] == 3
    assert summary["n_wrong"] == summary["n_failed"] == 0
    assert summary["n_false"] <= 1  # a doubtful name, in addition to a right one
    hits = {score["name"]: score["hits"] for score in summary["scores"]}
    assert hits["control_false"] == hits["artefact_as_effect"] == 0

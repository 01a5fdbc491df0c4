"""A small study with broad priors, end to end with the real discovery, as a user gets it: a few minutes."""

import json

import pytest

pytestmark = pytest.mark.slow


def test_the_first_of_two_drawn_data_sets_is_judged(run_blind, tmp_path):
    keys = ("priors=broad", "n_sets=2", "first=1", "followers=24", "duration=60.0", "seed=5", "sumo=false")
    summary = run_blind(tmp_path, "broad", *(f"blind.{key}" for key in keys))
    assert (summary["n_cases"], summary["n_failed"]) == (1, 0)
    everything = summary["strata"][0]
    assert everything["n_effects"] + everything["n_controls"] == 1
    verdicts = list((tmp_path / "broad" / "verdicts").glob("*.json"))
    assert len(verdicts) == 1
    assert all("verdict" in json.loads(path.read_text()) for path in verdicts)

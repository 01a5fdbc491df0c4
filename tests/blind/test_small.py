"""A data set of the small blind study, end to end with the real discovery: minutes, mostly compiling."""

import json
import subprocess
import sys

import pytest


@pytest.mark.slow
def test_a_small_study_names_what_is_hidden(tmp_path):
    words = ["discover", "blind", "blind.seed=3", "blind.sets=named*", "blind.first=1", "study=small"]
    command = [sys.executable, "-m", "rearl_jax", *words, f"results.root={tmp_path}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr[-3000:]
    summary = json.loads((tmp_path / "small" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["n_cases"], summary["n_right"]) == (1, 1)
    assert summary["n_wrong"] == summary["n_failed"] == 0
    assert summary["n_false"] <= 1  # a doubtful name, in addition to a right one
    (path,) = (tmp_path / "small" / "verdicts").glob("*.json")
    assert "verdict" in json.loads(path.read_text())

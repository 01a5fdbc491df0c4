"""A small study with broad priors, end to end with the real discovery, as a user gets it: a few minutes."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


def test_two_drawn_data_sets_are_judged(tmp_path):
    keys = ("priors=broad", "n_sets=2", "followers=24", "duration=60.0", "seed=5", "sumo=false")
    command = [sys.executable, "-m", "rearl_jax", "discover", "blind", *(f"blind.{key}" for key in keys)]
    done = subprocess.run(
        [*command, "study=broad", f"results.root={tmp_path}"],
        capture_output=True, text=True, timeout=1800, env={**os.environ},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    summary = json.loads((tmp_path / "broad" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["n_cases"], summary["n_failed"]) == (2, 0)
    everything = summary["strata"][0]
    assert (everything["n_effects"], everything["n_controls"]) == (1, 1)
    verdicts = list((tmp_path / "broad" / "verdicts").glob("*.json"))
    assert len(verdicts) == 2
    assert all("verdict" in json.loads(path.read_text()) for path in verdicts)

"""The small blind study, end to end with the real discovery: a few minutes, most of them compiling."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

SEED = 7


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    """The summary of the first five of its six data sets, as a user gets it."""
    folder = tmp_path_factory.mktemp("blind")
    keys = (f"blind.seed={SEED}", "blind.first=5", "study=small")
    command = [sys.executable, "-m", "rearl_jax", "discover", "blind", *keys]
    done = subprocess.run(
        [*command, f"results.root={folder}"], capture_output=True, text=True, timeout=1800, env={**os.environ}
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads((folder / "small" / "summary.json").read_text(encoding="utf-8"))


def test_small_study_finds_what_is_hidden(summary):
    assert summary["n_cases"] == 5
    assert summary["n_right"] >= 4
    assert summary["n_wrong"] == summary["n_failed"] == 0
    assert summary["n_false"] <= 1  # beside the variable of an effect that no list holds, a doubtful name may stand
    hits = {score["name"]: score["hits"] for score in summary["scores"]}
    assert hits["control_false"] == hits["artefact_as_effect"] == 0

"""`rearl study table1` with two rows, run once as a user runs it."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def quick():
    """Keys that make an evaluation small."""
    return ["eval.n_runs=1", "eval.resamples=200", "eval.noise_draws=50", "core.collisions=false"]


@pytest.fixture(scope="session")
def two_rows(quick):
    """The same, and two rows."""
    return ["table1.rows=[base,idle]", *quick]


@pytest.fixture(scope="session")
def rearl():
    """Runs the command with a results folder and gives back what it printed."""

    def run(root: Path, *words: str) -> str:
        command = [sys.executable, "-m", "rearl_jax", *words, f"results.root={root}"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def table1(tmp_path_factory, rearl, two_rows):
    """Folder of all results, and what was printed."""
    root = tmp_path_factory.mktemp("results")
    return root, rearl(root, "study", "table1", *two_rows)

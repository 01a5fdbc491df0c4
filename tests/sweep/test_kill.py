"""Sweeps killed at random moments, again and again: what is there in the end equals an uninterrupted sweep."""

import os
import random
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest

KEYS = ["core.collisions=false", "eval.resamples=200"]
SMALL_PARTS = """
import sys
from rearl_jax.cli import main
from rearl_jax.sweep import parts

parts.MAX_PART_ROLLOUTS = 40
sys.exit(main())
"""


def killed_and_finished(command, seed, last):
    """Kills the command five times, each time a little later, then lets it finish."""
    rng = random.Random(seed)
    patience, kills = 3.0, 0
    while kills < 5:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(rng.uniform(0, patience))
        if process.poll() is not None:
            # Too late: it had finished. Forget the end, so that there is something left to kill.
            assert process.returncode == 0
            last.unlink(missing_ok=True)
            patience *= 0.7
            continue
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        kills += 1
        patience *= 1.3
    subprocess.run(command, check=True, capture_output=True)


@pytest.mark.slow
def test_a_threshold_sweep_survives_being_killed(tmp_path):
    sweep = ["sweep", "thresholds", *KEYS, "eval.n_runs=8"]
    one, two = tmp_path / "killed", tmp_path / "whole"
    command = [sys.executable, "-c", SMALL_PARTS, *sweep]
    subprocess.run([*command, f"results.root={two}"], check=True, capture_output=True)
    killed_and_finished([*command, f"results.root={one}"], 1, one / "sweep_thresholds" / "summary.json")
    folders = [root / "sweep_thresholds" for root in (one, two)]
    parts = [sorted(path.name for path in (folder / "runs").iterdir()) for folder in folders]
    assert parts[0] == parts[1]
    assert len(parts[1]) > 10
    for name in ("runs", "table3.parquet", "base_values.parquet"):
        resumed, at_once = (pd.read_parquet(folder / name) for folder in folders)
        assert len(at_once) > 0
        pd.testing.assert_frame_equal(resumed, at_once)
    left = [path.name for path in folders[0].rglob("*") if "unfinished" in path.name]
    assert left == []


@pytest.mark.slow
def test_a_multirun_survives_being_killed(tmp_path):
    one, two = tmp_path / "killed", tmp_path / "whole"
    words = ["evaluate", "-m", *KEYS, "eval.n_runs=1", "detection.h_pct=5,30", "detection.m_pct=5,30", "study=s"]
    command = [sys.executable, "-m", "rearl_jax", *words]
    subprocess.run([*command, f"results.root={two}"], check=True, capture_output=True)
    killed_and_finished([*command, f"results.root={one}"], 2, one / "s" / "summary.json")
    for name in ("runs", "cells"):
        resumed, at_once = (pd.read_parquet(root / "s" / f"{name}.parquet") for root in (one, two))
        assert at_once["cell"].nunique() == 4
        pd.testing.assert_frame_equal(resumed, at_once)

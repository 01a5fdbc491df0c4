"""Cells of many rollouts on several Ray workers, one of which is killed: nothing is lost, nothing is there twice."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

SEEDS, N_ROLLOUTS = (0, 1, 2, 3), 2_000
"""Each of the cells is one part; two are simulated at a time, so that some are missing when a worker is killed."""

WORDS = ["sweep", "scale", "method=base", "core.collisions=false", f"n_rollouts={N_ROLLOUTS}", "study=s"]


def command(root: Path, *words: str) -> list[str]:
    return [sys.executable, "-m", "rearl_jax", *WORDS, f"results.root={root}", *words]


def jobs_of(process: subprocess.Popen) -> list[int]:
    """Ray's workers that carry out a job for a command; those without work call themselves idle."""
    parents, names = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "status").read_text()
                names[int(entry.name)] = (entry / "cmdline").read_text().split("\0")[0]
            except OSError:  # it has ended meanwhile
                continue
            parents[int(entry.name)] = int(status.partition("PPid:")[2].split()[0])

    def is_ours(pid: int) -> bool:
        while pid in parents and pid != process.pid:
            pid = parents[pid]
        return pid == process.pid

    return [pid for pid, name in names.items() if name.startswith("ray::") and "IDLE" not in name and is_ours(pid)]


def parts_in(root: Path) -> dict[Path, int]:
    """The time at which each part was written."""
    return {path: path.stat().st_mtime_ns for path in root.glob("s/eval.seed=*/runs/part-*.parquet")}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
def test_a_killed_worker_loses_nothing_and_repeats_nothing(tmp_path):
    sides = ("-m", f"eval.seed={','.join(map(str, SEEDS))}", "hydra/launcher=ray", "hydra.launcher.ray.init.num_cpus=2")
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    mine = {key: value for key, value in os.environ.items() if key != "RAY_ADDRESS"}
    with subprocess.Popen(command(killed, *sides), env=mine, stderr=subprocess.PIPE, text=True) as process:
        patience = time.monotonic() + 900
        while not parts_in(killed):
            assert process.poll() is None, process.stderr.read()
            assert time.monotonic() < patience, "no part was ever written"
            time.sleep(0.05)
        while not (jobs := jobs_of(process)):  # the next cells are on their way
            assert process.poll() is None
            time.sleep(0.05)
        os.kill(jobs[0], signal.SIGKILL)
        said = process.stderr.read()
    assert process.returncode != 0
    assert "a job was not completed" in said
    before = parts_in(killed)
    assert 0 < len(before) < len(SEEDS)
    # The same command goes on.
    done = subprocess.run(command(killed, *sides), env=mine, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    after = parts_in(killed)
    assert len(after) == len(SEEDS)
    assert before.items() <= after.items()  # what was there was left alone
    assert not [path for path in killed.rglob("*") if "unfinished" in path.name]

    frames = {seed: pd.read_parquet(killed / "s" / f"eval.seed={seed}" / "runs") for seed in SEEDS}
    for frame in frames.values():
        assert len(frame) == N_ROLLOUTS
        assert not frame.duplicated(["scene_id", "run"]).any()
    figures = pd.concat(frames.values())[["h", "spacing", "mape_a", "thw", "jerk_rms"]]
    assert not figures.duplicated().any()  # no two cells have simulated the same
    subprocess.run(command(whole, f"eval.seed={SEEDS[1]}"), env=mine, check=True, capture_output=True)
    pd.testing.assert_frame_equal(frames[SEEDS[1]], pd.read_parquet(whole / "s" / "runs"))

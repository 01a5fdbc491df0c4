"""Launchers of a multirun: the same rows whatever runs the jobs, the cores shared out, what is said where one fails.

Slurm is played by three small programs that do with a job array what `sbatch`, `srun` and `sacct` would.
"""

import json
import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
import yaml

from rearl_jax.cli import launchers
from rearl_jax.cli.composition import UsageError
from rearl_jax.cli.running import JobError
from rearl_jax.machine import available_cores
from tests.refusal import refused

CHEAP = ["study=s", "eval.resamples=50", "eval.noise_draws=10"]

SBATCH = """#!{python}
import os, re, subprocess, sys
script = sys.argv[1]
first, last = re.search(r"--array=([0-9]+)-([0-9]+)", open(script).read()).groups()
for index in range(int(first), int(last) + 1):
    job = {{"SLURM_JOB_ID": str(8 + index), "SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": str(index)}}
    quiet = subprocess.DEVNULL
    subprocess.Popen(["bash", script], env=os.environ | job, stdin=quiet, stdout=quiet, stderr=quiet)
print("Submitted batch job 7")
"""

SRUN = """#!{python}
import os, subprocess, sys
words, files = sys.argv[1:], {{}}
while words[0].startswith("--"):
    name = words.pop(0)
    if name in ("--output", "--error"):
        job = {{"%A": os.environ["SLURM_ARRAY_JOB_ID"], "%a": os.environ["SLURM_ARRAY_TASK_ID"], "%t": "0"}}
        files[name] = words.pop(0)
        for mark, value in job.items():
            files[name] = files[name].replace(mark, value)
        os.makedirs(os.path.dirname(files[name]), exist_ok=True)
with open(files["--output"], "w") as output, open(files["--error"], "w") as error:
    sys.exit(subprocess.call(words, stdout=output, stderr=error))
"""

SACCT = """#!{python}
print("JobID|State|NodeList")
"""


def multirun(folder: Path, *words: str, path: str = "") -> SimpleNamespace:
    """`rearl evaluate -m` in a folder of its own: exit code, what was said, the folder of the study."""
    folder.mkdir()
    mine = {key: value for key, value in os.environ.items() if key != "RAY_ADDRESS" and key not in launchers._LIMITS}
    done = subprocess.run(
        [sys.executable, "-m", "rearl_jax", "evaluate", "-m", *CHEAP, *words],
        cwd=folder,
        env={**mine, "PATH": f"{path}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        text=True,
    )
    assert [file.name for file in folder.iterdir()] == ["results"], done.stderr
    return SimpleNamespace(code=done.returncode, out=done.stdout, error=done.stderr, study=folder / "results" / "s")


@pytest.fixture(scope="module")
def one_after_another(tmp_path_factory):
    """Two jobs in the process that was called."""
    done = multirun(tmp_path_factory.mktemp("launchers") / "here", "eval.n_runs=1", "eval.seed=0,1")
    assert done.code == 0, done.error
    return done


def unmeasured(file: Path) -> object:
    """The summary without the times that were measured."""
    return [{key: value for key, value in row.items() if key != "seconds"} for row in json.loads(file.read_text())]


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["joblib", "ray", "submitit_local"])
def test_every_launcher_gives_the_same_rows(one_after_another, tmp_path, launcher):
    done = multirun(tmp_path / "side", "eval.n_runs=1", "eval.seed=0,1", f"hydra/launcher={launcher}")
    assert done.code == 0, done.error
    for table in ("runs", "cells"):
        expected = pd.read_parquet(one_after_another.study / f"{table}.parquet")
        assert set(expected["eval.seed"]) == {"0", "1"}
        pd.testing.assert_frame_equal(pd.read_parquet(done.study / f"{table}.parquet"), expected, check_exact=True)
    for cell in (".", "eval.seed=0", "eval.seed=1"):
        here, side = one_after_another.study / cell, done.study / cell
        assert json.loads((side / "config.json").read_text()) == json.loads((here / "config.json").read_text())
        assert unmeasured(side / "summary.json") == unmeasured(here / "summary.json")
    assert "2 cells of s" in done.out
    assert "dashboard" not in done.error.lower()

    told = yaml.safe_load((done.study / "multirun.yaml").read_text())["hydra"]
    assert told["job"]["env_set"] == dict.fromkeys(launchers._LIMITS, str(max(available_cores() // 2, 1)))


@pytest.fixture
def slurm(tmp_path):
    """A folder with `sbatch`, `srun` and `sacct`."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    for name, program in {"sbatch": SBATCH, "srun": SRUN, "sacct": SACCT}.items():
        (folder / name).write_text(program.format(python=sys.executable))
        (folder / name).chmod(0o755)
    return folder


@pytest.mark.slow
def test_slurm_keeps_its_logs_with_the_study_and_a_failing_job_is_heard(one_after_another, slurm, tmp_path):
    words = ("eval.n_runs=0,1", "hydra/launcher=submitit_slurm", "hydra.launcher.cpus_per_task=1")
    done = multirun(tmp_path / "side", *words, path=str(slurm))
    assert done.code == 2
    assert "eval.n_runs=0: eval.n_runs must be at least 1, got 0" in done.error
    assert "Traceback" not in done.error
    assert "eval.n_runs must be at least 1" in (done.study / "eval.n_runs=0" / "evaluate.log").read_text()
    expected = pd.read_parquet(one_after_another.study / "eval.seed=0" / "runs.parquet")
    rows = pd.read_parquet(done.study / "eval.n_runs=1" / "runs.parquet")
    pd.testing.assert_frame_equal(rows, expected, check_exact=True)
    assert set(pd.read_parquet(done.study / "runs.parquet")["cell"]) == {"n_runs=1"}
    assert "base on NGSIM US-101" in (done.study / ".submitit" / "7_1" / "7_1_0_log.out").read_text()


@pytest.fixture
def eight_cores(monkeypatch):
    monkeypatch.setattr(launchers, "available_cores", lambda: 8)
    monkeypatch.setattr(launchers.shutil, "which", lambda name: name)
    for name in ("RAY_ADDRESS", *launchers._LIMITS):
        monkeypatch.delenv(name, raising=False)


N_JOBS, CORES = "hydra.launcher.n_jobs", "hydra.launcher.cpus_per_task"
ADDRESS = "hydra.launcher.ray.init.address"
SIZE, STORE = "hydra.launcher.ray.init.num_cpus", "hydra.launcher.ray.init.object_store_memory"


@pytest.mark.parametrize(
    ("launcher", "said", "jobs", "cores", "also"),
    [
        ("joblib", {}, 3, 2, {N_JOBS: "3"}),
        ("joblib", {}, 20, 1, {N_JOBS: "8"}),
        ("joblib", {N_JOBS: 2}, 20, 4, {N_JOBS: "2"}),
        ("joblib", {N_JOBS: -5}, 20, 2, {N_JOBS: "4"}),
        ("ray", {}, 3, 2, {SIZE: "8", "hydra.launcher.ray.remote.num_cpus": "2"}),
        ("ray", {SIZE: 4}, 3, 1, {SIZE: "4"}),
        ("ray", {"hydra.launcher.ray.remote.num_cpus": 0.5}, 3, 1, {}),
        ("ray", {ADDRESS: "auto", "results.root": "/shared"}, 3, 1, {SIZE: "null", STORE: "null"}),
        ("submitit_local", {}, 20, 1, {}),
        ("submitit_local", {CORES: 3}, 20, 3, {}),
        ("submitit_slurm", {CORES: 4}, 20, 4, {}),
    ],
)
def test_jobs_side_by_side_share_the_cores(eight_cores, launcher, said, jobs, cores, also):
    words = launchers.settings({"hydra/launcher": launcher, **said}, jobs)
    told = dict(word.removeprefix("++").split("=", 1) for word in words)
    limits = {f"hydra.job.env_set.{name}": str(cores) for name in launchers._LIMITS}
    assert limits.items() <= told.items()
    assert also.items() <= told.items()


def test_cores_that_others_hand_out_are_left_alone(eight_cores, monkeypatch):
    assert launchers.settings({}, 3) == []
    assert launchers.settings({"hydra/launcher": "basic"}, 3) == []
    assert launchers.settings({"hydra/launcher": "submitit_slurm"}, 3) == []
    monkeypatch.setenv("JAX_NUM_CPU_DEVICES", "5")
    assert not [word for word in launchers.settings({"hydra/launcher": "joblib"}, 3) if "JAX_NUM" in word]


@pytest.mark.parametrize(
    ("said", "code", "key"),
    [
        ({"hydra/launcher": "submitit_slurm"}, "slurm-missing", "hydra/launcher"),
        ({"hydra/launcher": "joblib", N_JOBS: "many"}, "wrong-type", N_JOBS),
        ({"hydra/launcher": "ray", "hydra.launcher.ray.init.address": "auto"}, "folder-not-shared", "results.root"),
    ],
)
def test_a_launcher_that_cannot_be_used_says_what_to_do(eight_cores, monkeypatch, said, code, key):
    monkeypatch.setattr(launchers.shutil, "which", lambda name: None)
    with refused(code, UsageError, key=key):
        launchers.settings(said, 2)


@pytest.mark.parametrize("launcher", launchers._EXTRAS)
def test_a_launcher_that_is_not_installed_names_its_extra(eight_cores, monkeypatch, launcher):
    def missing(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(launchers, "distribution", missing)
    with refused("extra-missing", UsageError) as caught:
        launchers.settings({"hydra/launcher": launcher}, 2)
    assert f"[{launcher.partition('_')[0]}]" in caught.value.problem.remedy


def test_a_killed_job_is_a_fault_of_the_job(capsys):
    killed = type("TerminatedWorkerError", (Exception,), {"__module__": "joblib.externals.loky"})
    with pytest.raises(JobError), launchers.launcher_errors({}):
        raise killed("killed")
    with pytest.raises(ZeroDivisionError), launchers.launcher_errors({}):
        raise ZeroDivisionError
    with pytest.raises(KeyboardInterrupt), launchers.launcher_errors({"hydra/launcher": "submitit_slurm"}):
        raise KeyboardInterrupt
    assert "scancel" in capsys.readouterr().err

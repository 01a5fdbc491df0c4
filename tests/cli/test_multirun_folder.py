"""Folders of a multirun: one process at a time, one folder for every job."""

import json
import signal
import subprocess

import pytest

from rearl_jax import tasks
from rearl_jax.cli.composition import UsageError
from rearl_jax.cli.multirun import run_many
from rearl_jax.whole_files import claim
from tests.cli.test_ending import drive
from tests.refusal import refused

EVALUATE = next(task for task in tasks.TASKS if task.words == "evaluate")


def ended(process: "subprocess.Popen[str]") -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a process that has ended."""
    output, error = process.communicate(timeout=60)
    return process.returncode, output, error


@pytest.mark.parametrize(
    ("words", "code", "key"),
    [
        (["study=a,b"], "key-not-swept", "study"),
        (["eval.seed=1,2", "results.root=a,b"], "key-not-swept", "results.root"),
        (["results.resume=true,false"], "key-not-swept", "results.resume"),
        (["eval.seed=1,2,1"], "value-repeated", "eval.seed"),
    ],
)
def test_jobs_that_would_share_a_folder_are_refused(tmp_path, monkeypatch, words, code, key):
    monkeypatch.chdir(tmp_path)
    with refused(code, UsageError, key=key):
        run_many(EVALUATE, words, None)
    assert list(tmp_path.iterdir()) == []


def test_a_second_multirun_in_the_folder_is_refused_before_a_job_starts(tmp_path):
    first = drive(tmp_path, "-m", "lanes=9,1", "study=s")
    assert first.stdout is not None
    while first.stdout.readline() != "on the way\n":
        pass
    code, _, error = ended(drive(tmp_path, "-m", "lanes=1,2", "study=s"))
    assert (code, error.count("\n")) == (2, 1)
    assert not (tmp_path / "results" / "s" / "lanes=1").exists()
    first.send_signal(signal.SIGKILL)
    ended(first)
    assert ended(drive(tmp_path, "-m", "lanes=1,2", "study=s"))[0] == 0


def test_the_folder_is_free_while_no_multirun_writes_to_it(tmp_path):
    lock = claim(tmp_path / "results" / "s")
    assert lock is not None
    assert ended(drive(tmp_path, "-m", "lanes=1,2", "study=s"))[0] == 2
    del lock
    assert ended(drive(tmp_path, "-m", "lanes=1,2", "study=s"))[0] == 0


def test_a_multirun_of_one_job_is_that_job(tmp_path):
    code, output, _ = ended(drive(tmp_path, "-m", "study=s", "--json"))
    assert code == 0
    assert json.loads(output) == {
        "task": "drive",
        "results": "results/s",
        "rows": [{"results": "results/s", "task": "drive", "speed": 3.5, "lanes": 1}],
    }

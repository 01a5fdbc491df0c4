"""Folders that one process at a time writes to, disks that are full, folders that others must not write to."""

import errno
import json
import logging
import os
import platform
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from rearl_jax import whole_files
from rearl_jax.cache import write_arrays
from rearl_jax.results import Study
from rearl_jax.whole_files import FolderInUseError, is_private, private_folder

WRITER = """
import sys, time
from rearl_jax.results import Study
study = Study(sys.argv[1], "mine", {"key": sys.argv[2]}, "a task")
study.begin(resume=False)
print("begun", flush=True)
time.sleep(60)
"""

FULL = """
import resource, sys
import numpy as np, pandas as pd
from rearl_jax.cli.running import explained
from rearl_jax.results import Study
study = Study(sys.argv[1], "mine", {"key": 1}, "a task")
study.begin(resume=False)
study.write_table("rows", pd.DataFrame({"a": [1, 2]}))
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
try:
    study.write_table("rows", pd.DataFrame({"a": np.random.default_rng(0).random(100_000)}))
except OSError as error:
    print(explained(error))
"""

FULL_RECORD = """
import os, resource, sys
from rearl_jax.cli.running import explained, is_of_output
from rearl_jax.results import Study
study = Study(sys.argv[1], "mine", {"key": 1}, "a task")
study.begin(resume=False)
size = os.path.getsize(os.path.join(sys.argv[1], ".mine.files"))
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
try:
    study.write_text("a.txt", "a")
except OSError as error:
    print(error.filename, is_of_output(error))
"""


@pytest.fixture
def other(tmp_path):
    """Another process that writes to the study `mine`, killed at the end."""
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path), "a"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process:
        assert process.stdout.readline() == "begun\n"
        yield process
        process.kill()


def test_a_second_process_is_refused_before_it_changes_anything(tmp_path, other):
    study = Study(tmp_path, "mine", {"key": "b"}, "a task")
    with pytest.raises(FolderInUseError, match="another process is writing to .*mine.*study=NAME"):
        study.begin(resume=False)
    assert json.loads((tmp_path / "mine" / "config.json").read_text()) == {"key": "a"}
    Study(tmp_path, "beside", {"key": "b"}, "a task").begin(resume=False)
    other.kill()
    other.wait()
    study.begin(resume=False)
    assert json.loads((tmp_path / "mine" / "config.json").read_text()) == {"key": "b"}


def test_one_process_may_open_its_study_again_and_gives_it_back(tmp_path, request):
    first = Study(tmp_path, "mine", {"key": 1}, "a task")
    first.begin(resume=False)
    Study(tmp_path, "mine", {"key": 1}, "a task").begin(resume=False)
    del first
    request.getfixturevalue("other")  # begins


def test_a_file_system_without_locks_is_said_and_used(tmp_path, monkeypatch, caplog):
    def refuse(lock):
        raise NotImplementedError("no locks here")

    monkeypatch.setattr(whole_files.FileLock, "acquire", refuse)
    with caplog.at_level(logging.WARNING):
        assert whole_files.claim(tmp_path) is None
    assert "not protected" in caplog.text


@pytest.mark.skipif(not hasattr(os, "fork"), reason="limits of the size of files are those of POSIX")
def test_a_full_disk_leaves_the_old_table_and_says_what_to_do(tmp_path):
    done = subprocess.run([sys.executable, "-c", FULL, str(tmp_path)], capture_output=True, text=True, check=True)
    assert "free some space, or write elsewhere with results.root=FOLDER" in done.stdout
    assert "rows.parquet" in done.stdout
    assert sorted(path.name for path in (tmp_path / "mine").iterdir()) == ["config.json", "rows.parquet"]
    assert pd.read_parquet(tmp_path / "mine" / "rows.parquet")["a"].tolist() == [1, 2]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="limits of the size of files are those of POSIX")
def test_a_full_disk_at_the_record_of_files_names_the_record(tmp_path):
    command = [sys.executable, "-c", FULL_RECORD, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(tmp_path / ".mine.files"), "False"]


def test_content_is_on_disk_before_it_replaces_a_file(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: calls.append("fsync"))
    monkeypatch.setattr(os, "replace", lambda old, new: calls.append("replace"))
    with whole_files.replacing(tmp_path / "a") as unfinished:
        unfinished.write_text("a")
    assert calls == ["fsync", "replace"]


def test_a_file_system_without_a_way_to_the_disk_is_used(tmp_path, monkeypatch):
    def refuse(descriptor):
        raise OSError(errno.EINVAL, "not here")

    monkeypatch.setattr(os, "fsync", refuse)
    with whole_files.replacing(tmp_path / "a") as unfinished:
        unfinished.write_text("a")
    assert (tmp_path / "a").read_text() == "a"


def test_stored_arrays_replace_what_ended_processes_left_unfinished(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    left = tmp_path / f".b.npz.{platform.node()}.{ended.pid}.unfinished"
    in_use = tmp_path / f".b.npz.{platform.node()}.{os.getppid()}.unfinished"
    for path in (left, in_use):
        path.touch()
    write_arrays(tmp_path / "a.npz", {"a": np.zeros(2)})
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([in_use.name, "a.npz"])


@pytest.mark.parametrize("mode", [0o777, 0o702, 0o700, 0o775])
def test_folders_that_everybody_can_write_to_are_not_private(tmp_path, mode):
    private_folder(tmp_path / "new" / "cache")
    assert (tmp_path / "new" / "cache").stat().st_mode & 0o777 == 0o700
    assert is_private(tmp_path / "new" / "cache")
    (tmp_path / "new" / "cache").chmod(mode)
    assert is_private(tmp_path / "new" / "cache") == (not mode & 0o002)

"""The folder of compiled programs after a process was killed while storing one, and on a full disk."""

import os
import subprocess
import sys
import warnings
import zlib
from pathlib import Path

import pytest

from rearl_jax.cli.compiled_programs import explain_warnings

READING = "Error reading persistent compilation cache entry for 'jit_run': error: Error -5 while decompressing"
WRITING = "Error writing persistent compilation cache entry for 'jit_run': OSError: [Errno 28] No space left on device"

COMPUTE = """
import resource, sys
import jax
from rearl_jax import tasks
from rearl_jax.cli.running import _start_jax

_start_jax(tasks.TASKS[0])
if len(sys.argv) > 1:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
jax.jit(lambda x: x * 3 + 1)(jax.numpy.ones(5)).block_until_ready()
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Folder with two whole programs and a damaged one, whose warnings are explained."""
    for name in ("jit_run-1-cache", "jit_run_all-1-cache"):
        (tmp_path / name).write_bytes(zlib.compress(b"program"))
    (tmp_path / "jit_run-2-cache").write_bytes(zlib.compress(b"program" * 99)[:10])
    monkeypatch.setattr(warnings, "showwarning", lambda *shown: print(shown[0]))
    explain_warnings(tmp_path)
    return tmp_path


def show(message: str) -> None:
    warnings.showwarning(UserWarning(message), UserWarning, "compiler.py", 1)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("message", [READING, WRITING])
def test_a_damaged_program_is_removed_and_said_once(folder, message, caplog):
    show(message)
    assert names(folder) == ["jit_run-1-cache", "jit_run_all-1-cache"]
    show(message)
    assert [str(folder) in record.getMessage() for record in caplog.records] == [True]


def test_a_program_that_cannot_be_loaded_is_removed_although_it_seems_whole(folder):
    (folder / "jit_run-2-cache").unlink()
    show(READING)
    assert names(folder) == ["jit_run_all-1-cache"]


def test_other_warnings_are_shown_as_before(folder, capsys):
    show("something else")
    assert capsys.readouterr().out == "something else\n"
    assert len(names(folder)) == 3


def compute(cache: Path, *limit: int) -> str:
    """Standard error of a process that compiles a program."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "XDG_"))}
    environment |= {"JAX_PLATFORMS": "cpu", "XDG_CACHE_HOME": str(cache)}
    command = [sys.executable, "-c", COMPUTE, *map(str, limit)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="limits of the size of files are those of POSIX")
def test_programs_cut_by_a_full_disk_or_a_kill_are_stored_again(tmp_path):
    programs = tmp_path / "rearl_jax" / "jax"
    assert compute(tmp_path, 100).count("\n") == 1
    assert names(programs) == []
    assert compute(tmp_path) == ""
    stored = {path: path.read_bytes() for path in programs.iterdir()}
    assert len(stored) >= 1
    for path, content in stored.items():
        path.write_bytes(content[: len(content) // 2])
    assert compute(tmp_path).count("\n") == 1
    assert compute(tmp_path) == ""
    assert {path: len(zlib.decompress(path.read_bytes())) > 0 for path in programs.iterdir()} == dict.fromkeys(
        stored, True
    )


NO_KERNEL = """
from types import SimpleNamespace
from rearl_jax.cli.running import _start_jax
_start_jax(SimpleNamespace(x64=True))
import numpy as np
from rearl_jax.core.batch import ScenarioMap
from tests.core.test_loops import X, scattered
assert np.any(ScenarioMap(scattered, chunk=7, loops_as_kernels=True)(X) != 0.0)
"""


def test_what_the_compiler_logs_before_it_is_asked_otherwise_is_not_shown(tmp_path):
    ours = ("TF_CPP_MIN_LOG_LEVEL", "XLA_FLAGS")
    environment = {name: value for name, value in os.environ.items() if name not in ours}
    environment |= {"JAX_PLATFORMS": "cpu", "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", NO_KERNEL]
    root = Path(__file__).parents[2]
    done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, check=True)
    assert done.stderr == ""

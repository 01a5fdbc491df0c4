"""A command with little memory, without a cache, and with standard streams that cannot be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rearl_jax.cli.running import explained
from tests.cli.test_ending import drive

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="limits and devices of Linux")

LIMITED = """
import resource, sys
from rearl_jax import tasks
from rearl_jax.cli.running import _start_jax, address_space

if len(sys.argv) > 1:
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]), resource.RLIM_INFINITY))
_start_jax(tasks.TASKS[0])
print(address_space())
"""


def started(home: Path, *limit: int) -> "subprocess.CompletedProcess[str]":
    """A process that has started JAX with a limit of its address space [bytes]."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "XDG_"))}
    environment |= {"JAX_PLATFORMS": "cpu", "HOME": str(home)}
    command = [sys.executable, "-c", LIMITED, *map(str, limit)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True)


def test_a_limited_address_space_is_said(tmp_path):
    limit = 64 * 2**30
    done = started(tmp_path, limit)
    assert done.stdout.split() == [str(limit)]
    assert done.stderr.count("\n") == 1
    assert "64.0 GiB" in done.stderr


def test_a_home_that_is_no_folder_is_one_sentence(tmp_path):
    (tmp_path / "home").touch()
    done = started(tmp_path / "home")
    assert done.stdout.split() == ["None"]
    assert done.stderr.count("\n") == 1
    assert "JAX_COMPILATION_CACHE_DIR" in done.stderr


@pytest.mark.parametrize(("error", "in_brackets"), [(MemoryError("8 GiB"), " (8 GiB)"), (MemoryError(), "")])
def test_missing_memory_is_said_with_what_is_known(error, in_brackets):
    assert explained(error).startswith(f"not enough memory{in_brackets}: ")


def test_the_exit_code_of_an_error_does_not_depend_on_standard_error(tmp_path):
    with open("/dev/full", "w") as full:
        assert drive(tmp_path, "lanes=x", stdout=full, stderr=full).wait(timeout=60) == 2
        assert drive(tmp_path, "study=s", stdout=full, stderr=full).wait(timeout=60) == 2

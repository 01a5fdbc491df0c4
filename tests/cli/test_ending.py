"""Ends of a command: by a signal, with nobody reading, with a summary in JSON; and its messages then."""

import errno
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from rich.progress import Progress

from rearl_jax import runtime
from rearl_jax.cli import main
from rearl_jax.cli.command_line import _continuation, _parser, _task
from rearl_jax.cli.composition import check_overrides
from rearl_jax.cli.interruption import Ended, ended_by_signals, exit_code, name_of
from rearl_jax.cli.running import explained, is_for_user
from rearl_jax.progress import TimeLeftColumn, in_words
from rearl_jax.tasks import TASKS

TASK = """
import json, signal, sys, time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from rearl_jax import tasks
from rearl_jax.cli import main
from rearl_jax.config._key import key
from rearl_jax.tasks import Task

@dataclass(unsafe_hash=True)
class Results:
    "Where results go"
    root: str = key("results", "folder")
    resume: bool = key(False, "leave a finished study alone")

@dataclass(unsafe_hash=True)
class Drive:
    "A drive"
    study: str = key("drive", "name")
    lanes: int = key(1, "lanes")
    results: Results = key(Results, "results")

def run(config):
    folder = Path(config.results.root) / config.study
    folder.mkdir(parents=True, exist_ok=True)
    try:
        print("on the way", flush=True)
        time.sleep(60 if config.lanes == 9 else 0)
    finally:
        (folder / "tidy").touch()
    (folder / "summary.json").write_text(json.dumps([{"task": "drive", "speed": 3.5, "lanes": config.lanes}]))
    return {}

# As of a terminal: shells let what they start in the background ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
if "study=deaf" in sys.argv:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
module = ModuleType("drive_task")
module.Drive, module.run = Drive, run
sys.modules["drive_task"] = module
task = Task("drive", "drive_task:run", "drive_task:Drive", "drive", "Drives.", ("rearl drive",), uses_jax=False)
conf = Path("conf")
conf.mkdir(exist_ok=True)
(conf / "drive.yaml").write_text("defaults: [schema, _self_]\\n")
tasks.TASKS, tasks.conf_dir = (task,), lambda: conf.resolve()
tasks.sweeps_dir = tasks.conf_dir
sys.exit(main())
"""


def drive(folder: Path, *words: str, **options) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", TASK, "drive", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.Popen(command, cwd=folder, text=True, **pipes)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="signals of POSIX")
@pytest.mark.parametrize(("number", "name"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")])
def test_a_signal_ends_in_an_orderly_way_and_says_how_to_go_on(tmp_path, number, name):
    process = drive(tmp_path, "lanes=9", "study=s")
    assert process.stdout is not None
    assert process.stdout.readline() == "on the way\n"
    process.send_signal(number)
    _, error = process.communicate(timeout=120)
    assert process.returncode == 128 + number
    assert error == (
        f"rearl: interrupted by {name}; nothing of an unfinished run is stored, start again with: "
        "rearl drive lanes=9 study=s\n"
    )
    assert (tmp_path / "results" / "s" / "tidy").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [("evaluate study=s", "nothing of an unfinished run is stored")]
    + [(words, "finished parts are stored") for words in ("evaluate -m eval.seed=1,2", "validate", "study fig7")]
    + [("study table4", "finished parts are stored"), ("cluster bo.enabled=true", "finished parts are stored")]
    + [("dine", ""), ("", "")],
)
def test_what_is_kept_of_a_task_that_was_ended(words, said):
    sentence = _continuation(words.split())
    assert said in sentence
    assert sentence.endswith(f"with: rearl {words}" if said else "")
    assert bool(said) == bool(sentence)


def test_who_ignores_a_signal_is_left_alone(tmp_path):
    process = drive(tmp_path, "lanes=9", "study=deaf")
    assert process.stdout is not None
    with process:
        assert process.stdout.readline() == "on the way\n"
        process.send_signal(signal.SIGHUP)
        time.sleep(0.5)
        assert process.poll() is None
        process.kill()


def test_handlers_are_put_back():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(Ended) as caught, ended_by_signals():  # noqa: PT012 - the signal arrives in the block
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(1)
    assert (name_of(caught.value), exit_code(caught.value)) == ("SIGTERM", 143)
    assert exit_code(KeyboardInterrupt()) == 130
    assert signal.getsignal(signal.SIGTERM) is before


def test_json_is_alone_on_standard_output(tmp_path):
    row = {"task": "drive", "speed": 3.5}
    jobs = [{"results": f"results/s/lanes={n}"} | row | {"lanes": n} for n in (2, 3)]
    for words, rows in ((["study=s"], [row | {"lanes": 1}]), (["study=s", "-m", "lanes=2,3"], jobs)):
        output, error = (process := drive(tmp_path, *words, "--json")).communicate(timeout=60)
        assert process.returncode == 0
        assert output.count("\n") == 1
        assert json.loads(output) == {"task": "drive", "results": "results/s", "rows": rows}
        assert "on the way" in error
        assert "results: results/s" in error
    output, error = (process := drive(tmp_path, "lanes=x", "--json")).communicate(timeout=60)
    assert (process.returncode, output) == (2, "")
    assert error.startswith("rearl: lanes ")


def test_nobody_reads_the_output(tmp_path):
    read, write = os.pipe()
    os.close(read)
    process = drive(tmp_path, "study=s", stdout=write)
    os.close(write)
    _, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (141, "")


def test_a_table_that_nobody_reads_does_not_end_the_work():
    code = (
        "import os; read, write = os.pipe(); os.close(read); os.dup2(write, 1)\n"
        "from rearl_jax.console import standard_output, titled_table\n"
        "standard_output(80).print(titled_table('x'))\n"
        "print('more'); os.write(2, b'done')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "done"


def test_words_that_begin_several_tasks_list_them(capsys):
    assert main(["study", "--help"]) == 0
    said = capsys.readouterr().out
    assert "rearl study table1 table1.rows=" in said
    assert said.count("\nrearl study fig") == 3
    assert main(["discover", "--help"]) == 0  # a task of its own
    assert "data.root=" in capsys.readouterr().out


def test_help_says_exit_codes_and_every_task_has_examples_that_compose(capsys, monkeypatch, tmp_path):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert "130 " in said
    assert "rearl doctor" in said
    for task in TASKS:
        assert task.examples
        for example in task.examples:
            words = shlex.split(example.partition(" | ")[0])
            assert words[0] == "rearl"
            options = _parser().parse_intermixed_args(words[1:])
            meant = _task(options.words)
            overrides = options.words[len(meant.words.split()) :]
            if meant.on_file is None or len(overrides) != 1 or "=" in overrides[0]:
                check_overrides(meant, overrides, None)


def test_errors_of_the_file_system_come_with_a_remedy():
    assert "free some space" in explained(OSError(errno.ENOSPC, "No space left on device", "/x"))
    assert "results.root=FOLDER" in explained(PermissionError(errno.EACCES, "Permission denied", "/x"))
    assert "study=NAME" in explained(FileExistsError(errno.EEXIST, "File exists", "/x"))
    assert "study=NAME" in explained(NotADirectoryError(errno.ENOTDIR, "Not a directory", "/x"))
    assert "name a file" in explained(IsADirectoryError(errno.EISDIR, "Is a directory", "/x"))
    assert "shorter" in explained(OSError(errno.ENAMETOOLONG, "File name too long", "/x"))
    assert explained(FileNotFoundError("say what is missing")) == "say what is missing"
    assert explained(ValueError("lanes must be 1")) == "lanes must be 1"


def test_too_little_memory_is_no_fault_of_the_program():
    with pytest.raises(MemoryError) as caught:
        np.zeros(10**15)
    assert is_for_user(caught.value)
    assert "PiB" in explained(caught.value)


def test_warnings_that_are_errors_are_told_in_one_sentence(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    runtime._set_compilation_cache.cache_clear()
    with pytest.raises(UserWarning) as caught:  # the tests turn warnings into errors
        runtime._set_compilation_cache()
    assert is_for_user(caught.value)


@pytest.mark.parametrize(("seconds", "said"), [(0.4, "0 s"), (99, "99 s"), (720, "12 min"), (12_600, "3.5 h")])
def test_the_time_left_is_said_in_words(seconds, said):
    assert in_words(seconds) == said


def test_a_line_says_how_long_it_will_take():
    now = 0.0
    bar = Progress(get_time=lambda: now, speed_estimate_period=600)
    line = bar.add_task("x", total=10)
    for done in range(1, 4):
        now = 60.0 * done
        bar.update(line, completed=done)
    assert TimeLeftColumn().render(bar.tasks[0]).plain == "7 min left"
    bar.update(line, completed=10)
    assert TimeLeftColumn().render(bar.tasks[0]).plain == ""

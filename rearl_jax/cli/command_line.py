"""Reads the task and its options from the command line.

Errors of the user end with one sentence and exit code 2, errors of the program with a traceback and exit code 1.
Ctrl-C, SIGTERM and SIGHUP end a task in an orderly way and print the command that continues it.
"""

import argparse
import functools
import logging
import os
import shlex
import sys
from typing import Any, NoReturn

from rearl_jax import tasks
from rearl_jax.cli.composition import UsageError, compose_task, repeated_keys
from rearl_jax.cli.help import general_help, group_help, task_help, tasks_beginning_with
from rearl_jax.cli.interruption import ended_by_signals, exit_code, name_of
from rearl_jax.cli.multirun import run_many
from rearl_jax.cli.running import complain, explained, is_for_user, is_of_output, run_task
from rearl_jax.cli.streams import make_writable
from rearl_jax.cli.summary_output import multirun_object, standard_output_apart, summary_object, write_object
from rearl_jax.cli.sweep_files import read_sweep
from rearl_jax.code_version import __version__
from rearl_jax.config._schema import nearest
from rearl_jax.problems import Problem
from rearl_jax.tasks import Task

DONE, FAILED, UNUSABLE, BROKEN_PIPE = 0, 1, 2, 141
"""Exit codes; a task ended by a signal has 128 plus the number of the signal."""


def main(argv: list[str] | None = None) -> int:
    """Exit code of `rearl`.

    0 done, 1 a check has failed (errors of the program are raised, which gives 1 as well), 2 an error in the input, 130
    interrupted by Ctrl-C, 143 by SIGTERM, 129 by SIGHUP, 141 standard output was closed by its reader.
    """
    arguments = sys.argv[1:] if argv is None else list(argv)
    make_writable()
    show_traceback = "--traceback" in arguments or os.environ.get("HYDRA_FULL_ERROR") == "1"
    try:
        with ended_by_signals():
            code = _dispatch(arguments)
            sys.stdout.flush()
            return code
    except KeyboardInterrupt as stop:
        complain(f"interrupted by {name_of(stop)}{_continuation(arguments)}")
        return exit_code(stop)
    except BrokenPipeError:
        _discard_output()
        return BROKEN_PIPE
    except Exception as error:
        if show_traceback or not is_for_user(error):
            raise
        complain(explained(error))
        if is_of_output(error):
            _discard_output()
        return UNUSABLE


def _discard_output() -> None:
    from rearl_jax.console import silence_standard_output

    silence_standard_output()


def _dispatch(arguments: list[str]) -> int:
    options = _parser().parse_intermixed_args(arguments)
    if options.version:
        print(f"rearl_jax {__version__}")
        return DONE
    if not options.words:
        print(general_help())
        return DONE
    if options.help and (group := tasks_beginning_with(options.words)):
        print(group_help(group))
        return DONE
    task = _task(options.words)
    overrides = options.words[len(task.words.split()) :]
    if options.help:
        print(task_help(task, overrides))
        return DONE
    for word in repeated_keys(overrides):
        complain(f"{word.partition('=')[0]} is given more than once; the last one counts: {word}")
    if options.config and (options.multirun or options.sweep):
        conflict = "prints the configuration of one job: leave out -m and --sweep"
        raise UsageError(Problem("options-conflict", conflict, key="--config"))
    if options.sweep:
        overrides = [*read_sweep(options.sweep, task, options.config_dir), *overrides]
    if options.config:
        from omegaconf import OmegaConf

        print(OmegaConf.to_yaml(OmegaConf.structured(compose_task(task, overrides, options.config_dir))), end="")
        return DONE
    if task.on_file is not None and any(_is_file(word) for word in overrides):
        run = functools.partial(_describe_file, task, overrides)
    else:
        run = functools.partial(_run, task, overrides, options)
    if not options.json:
        return run()[0]
    with standard_output_apart() as output:
        code, summary = run()
        write_object(summary, output)
    return code


def _describe_file(task: Task, words: list[str]) -> tuple[int, dict[str, Any]]:
    """Exit code and result of `rearl TASK FILE`, which describes an unknown file or folder."""
    if len(words) > 1:
        conflict = f"takes one file and no keys: rearl {task.words} {shlex.quote(next(filter(_is_file, words)))}"
        raise UsageError(Problem("file-and-keys", conflict, key=f"rearl {task.words} FILE"))
    return DONE, {"task": task.words, **task.load_on_file()(words[0])}


def _is_file(word: str) -> bool:
    """True if a word names a file or folder and not a key: it exists, or looks like a path."""
    if word.startswith(("/", "./", "../")):
        return True
    return "=" not in word and ("." in word or os.sep in word or os.path.exists(word))


def _run(task: Task, overrides: list[str], options: argparse.Namespace) -> tuple[int, dict[str, Any]]:
    """Exit code and the summary that `--json` prints."""
    # Before the configuration is composed, because keys that imply others are logged then.
    logging.basicConfig(format="%(message)s")
    logging.getLogger("rearl_jax").setLevel(logging.INFO)
    if options.multirun or options.sweep:
        folder, cells = run_many(task, overrides, options.config_dir)
        return DONE, multirun_object(task, folder, cells)
    config = compose_task(task, overrides, options.config_dir)
    folder, returned = run_task(task, config)
    is_failed = task.failures is not None and returned[task.failures] > 0
    return FAILED if is_failed else DONE, summary_object(task, folder, returned)


def _continuation(arguments: list[str]) -> str:
    """End of the message after an interruption: whether results are stored, and the command that continues."""
    try:
        options = _parser().parse_intermixed_args(arguments)
        task = _task(options.words)
    except (UsageError, IndexError):
        return ""
    command = shlex.join(["rearl", *arguments])
    if task.resumes or options.multirun or options.sweep:
        return f"; finished parts are stored, continue with: {command}"
    return f"; nothing of an unfinished run is stored, start again with: {command}"


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(Problem("option-unknown", f"{message}; `rearl --help` lists tasks and options"))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="rearl", add_help=False, allow_abbrev=False)
    parser.add_argument("words", nargs="*")
    parser.add_argument("-h", "--help", action="store_true")
    parser.add_argument("-m", "--multirun", action="store_true")
    parser.add_argument("--sweep")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--config", action="store_true")
    parser.add_argument("--config-dir")
    parser.add_argument("--traceback", action="store_true")
    parser.add_argument("--version", action="store_true")
    return parser


def _task(words: list[str]) -> Task:
    if "=" in words[0]:
        remedy = f"name a task before {words[0]!r}: rearl TASK {words[0]}"
        raise UsageError(Problem("task-missing", remedy))
    # Longest names first, so that `discover blind` is found before `discover`.
    for task in sorted(tasks.TASKS, key=lambda task: -len(task.words.split())):
        if words[: len(task.words.split())] == task.words.split():
            return task
    unknown = " ".join(word for word in words[:2] if "=" not in word)
    beginning = [task.words for task in tasks.TASKS if task.words.startswith(f"{words[0]} ")]
    close = nearest(unknown, beginning or [task.words for task in tasks.TASKS])
    listed = f"is not a task; nearest: rearl {close}; `rearl --help` lists all tasks"
    raise UsageError(Problem("task-unknown", listed, key=unknown))

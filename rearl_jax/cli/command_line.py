"""The words of the command line: which task, which options.

Mistakes of the user end with one sentence and exit code 2, mistakes of the program with a traceback and exit code 1.
"""

import argparse
import logging
import os
import sys
from typing import NoReturn

from rearl_jax import __version__, tasks
from rearl_jax.cli.composition import UsageError, compose_task
from rearl_jax.cli.help import general_help, task_help
from rearl_jax.cli.multirun import run_many
from rearl_jax.cli.running import complain, is_for_user, run_task
from rearl_jax.cli.sweep_files import read_sweep
from rearl_jax.config._schema import nearest
from rearl_jax.tasks import Task


def main(argv: list[str] | None = None) -> int:
    """Exit code of `rearl`: 0 done, 2 a fault the user can mend, 130 interrupted; other faults are raised."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    show_traceback = "--traceback" in arguments or os.environ.get("HYDRA_FULL_ERROR") == "1"
    try:
        _dispatch(arguments)
    except KeyboardInterrupt:
        complain("interrupted")
        return 130
    except Exception as error:
        if show_traceback or not is_for_user(error):
            raise
        complain(str(error))
        return 2
    return 0


def _dispatch(arguments: list[str]) -> None:
    options = _parser().parse_intermixed_args(arguments)
    if options.version:
        print(f"rearl_jax {__version__}")
        return
    if not options.words:
        print(general_help())
        return
    task = _task(options.words)
    overrides = options.words[len(task.words.split()) :]
    if options.help:
        print(task_help(task))
    elif options.multirun or options.sweep:
        if options.sweep:
            overrides = [*read_sweep(options.sweep, task, options.config_dir), *overrides]
        run_many(task, overrides, options.config_dir)
    else:
        config = compose_task(task, overrides, options.config_dir)
        if options.config:
            from omegaconf import OmegaConf

            print(OmegaConf.to_yaml(OmegaConf.structured(config)), end="")
            return
        logging.basicConfig(format="%(message)s")
        logging.getLogger("rearl_jax").setLevel(logging.INFO)
        run_task(task, config)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; `rearl --help` lists tasks and options")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="rearl", add_help=False, allow_abbrev=False)
    parser.add_argument("words", nargs="*")
    parser.add_argument("-h", "--help", action="store_true")
    parser.add_argument("-m", "--multirun", action="store_true")
    parser.add_argument("--sweep")
    parser.add_argument("--config", action="store_true")
    parser.add_argument("--config-dir")
    parser.add_argument("--traceback", action="store_true")
    parser.add_argument("--version", action="store_true")
    return parser


def _task(words: list[str]) -> Task:
    if "=" in words[0]:
        raise UsageError(f"name a task before {words[0]!r}: rearl TASK {words[0]}")
    # `discover blind` before `discover`.
    for task in sorted(tasks.TASKS, key=lambda task: -len(task.words.split())):
        if words[: len(task.words.split())] == task.words.split():
            return task
    said = " ".join(word for word in words[:2] if "=" not in word)
    beginning = [task.words for task in tasks.TASKS if task.words.startswith(f"{words[0]} ")]
    close = nearest(said, beginning or [task.words for task in tasks.TASKS])
    raise UsageError(f"there is no task {said!r}; nearest: rearl {close}; `rearl --help` lists all tasks")

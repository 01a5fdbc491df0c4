"""A task carried out, and which faults are the user's to mend."""

import gc
import os
import sys
from pathlib import Path
from typing import Any

from rearl_jax.tasks import Task

_PACKAGE = str(Path(__file__).resolve().parents[1])


class JobError(RuntimeError):
    """One job of a multirun failed for a reason the user can mend."""


def run_task(task: Task, config: Any) -> None:
    """Runs the task's function and says where its results are."""
    from rearl_jax import runtime

    runtime.start(x64=task.x64)
    run = task.load_run()
    # What is imported stays to the end, and so do traced programs: to look through them all takes 0.2 s as measured, in
    # the midst of a burst of requests every few seconds.
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
    run(config)
    folder = Path(config.results.root) / config.study
    if folder.is_dir():
        print(f"results: {folder}")


def is_for_user(error: BaseException) -> bool:
    """Whether an error speaks to the user: raised with a message by this package, or by the file system."""
    if isinstance(error, (OSError, JobError)):
        return True
    if not isinstance(error, (ValueError, ImportError)) or error.__traceback__ is None:
        return False
    last = error.__traceback__
    while last.tb_next is not None:
        last = last.tb_next
    return last.tb_frame.f_code.co_filename.startswith(_PACKAGE + os.sep)


def complain(message: str) -> None:
    """One sentence on standard error, red where that is a terminal."""
    colour = sys.stderr.isatty() and "NO_COLOR" not in os.environ
    start, stop = ("\033[31m", "\033[0m") if colour else ("", "")
    print(f"{start}rearl: {message}{stop}", file=sys.stderr)

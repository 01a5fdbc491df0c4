"""Runs a task, and distinguishes errors of the user from errors of the program."""

import errno
import gc
import logging
import os
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

from rearl_jax.jax_import import import_jax
from rearl_jax.problems import ProblemError
from rearl_jax.tasks import Task
from rearl_jax.whole_files import is_private, private_folder

log = logging.getLogger(__name__)

_PACKAGE = str(Path(__file__).resolve().parents[1])


class JobError(RuntimeError):
    """One job of a multirun failed for a reason the user can correct."""


def run_task(task: Task, config: Any) -> tuple[Path | None, dict]:
    """Runs the task; returns the folder of its results and the value of its function, and prints the folder."""
    if task.uses_jax:
        _start_jax(task)
    run = task.load_run()
    # Imported modules and traced programs exist until the end. Without these lines garbage collection would visit them
    # all every few seconds during requests and take 0.2 s each time (measured).
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
    returned = run(config)
    folder = folder_of(config)
    if folder is not None:
        print(f"results: {folder}")
    return folder, returned


def folder_of(config: Any) -> Path | None:
    """Folder of the results of a task; None if it has written none."""
    if not hasattr(config, "study"):
        return None
    folder = Path(config.results.root) / config.study
    return folder if folder.is_dir() else None


def _start_jax(task: Task) -> None:
    # Read at the import. XLA also logs what it then raises, such as a loop that it cannot translate as one kernel.
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
    import_jax()
    from rearl_jax import runtime
    from rearl_jax.cli.compiled_programs import explain_warnings

    # A multirun shows the log of every library, in which JAX would report that it found no TPU.
    logging.getLogger("jax").setLevel(logging.WARNING)
    is_safe = _is_private_cache(runtime.cache_folder())
    with warnings.catch_warnings(record=True) as given:
        runtime.start(x64=task.x64)
    for warning in given:
        log.warning("%s", warning.message)
    if limit := address_space():
        log.warning(
            "the address space of this process is limited to %.1f GiB, and the process aborts if it needs more: raise "
            "the limit (ulimit -v unlimited), or ask for fewer scenes, runs, vehicles or seconds at a time",
            limit / 2**30,
        )
    import jax

    if not is_safe:
        jax.config.update("jax_enable_compilation_cache", False)
    elif folder := getattr(jax.config, "jax_compilation_cache_dir", None):
        explain_warnings(Path(folder))


def address_space() -> int | None:
    """Largest address space of this process [bytes], as set by `ulimit -v`; None without a limit."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _is_private_cache(cache: Path) -> bool:
    """True if no other user can write to the cache, whose compiled programs run without checks; warns otherwise.

    A missing folder is created with access for this user alone.
    """
    try:
        private_folder(cache.parent)
        private_folder(cache)
        if all(map(is_private, (cache.parent, cache))):
            return True
    except OSError:
        return True  # the cache cannot be created; runtime.start reports it
    complain(
        f"other users can write to {cache}, so the cache of compiled programs is not used; make the folder your own "
        "(chmod o-w, chown), or set XDG_CACHE_HOME"
    )
    return False


def is_for_user(error: BaseException) -> bool:
    """True if the message of an error is meant for the user: raised by this package, or caused by files or memory.

    Warnings are included, because PYTHONWARNINGS=error raises them.
    """
    if isinstance(error, (OSError, MemoryError, JobError, ProblemError)):
        return True
    if not isinstance(error, (ValueError, ImportError, Warning)) or error.__traceback__ is None:
        return False
    innermost = error.__traceback__
    while innermost.tb_next is not None:
        innermost = innermost.tb_next
    return innermost.tb_frame.f_code.co_filename.startswith(_PACKAGE + os.sep)


def is_of_output(error: BaseException) -> bool:
    """True if standard output could not be written, as on a full disk; errors of other files have a file name."""
    full = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
    return isinstance(error, OSError) and error.errno in full and error.filename is None


def explained(error: BaseException) -> str:
    """Message to the user about an error, with a remedy for lack of memory and errors of the file system."""
    if isinstance(error, MemoryError):
        detail = f" ({error})" if str(error) else ""
        return f"not enough memory{detail}: ask for fewer scenes, runs, vehicles or seconds at a time"
    if not isinstance(error, OSError) or error.errno is None:
        return str(error)
    if is_of_output(error):
        return (
            f"standard output cannot be written ({error.strerror}): redirect it elsewhere; results that are stored are "
            "not affected"
        )
    message = str(error)
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return (
            f"{message}: free some space, or write elsewhere with results.root=FOLDER; then give the same command again"
        )
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"{message}: allow it, or name other folders, results.root=FOLDER for results, data.root for recordings"
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        return f"{message}: a file is where a folder must be; move it, or set another study=NAME or results.root=FOLDER"
    if error.errno == errno.EISDIR:
        return f"{message}: a folder is where a file must be; name a file"
    if error.errno == errno.ENAMETOOLONG:
        return f"{message}: choose a shorter study=NAME or results.root=FOLDER"
    return message


def complain(message: str) -> None:
    """Prints one sentence on standard error, in red if that is a terminal; nothing if it cannot be written."""
    colour = sys.stderr.isatty() and "NO_COLOR" not in os.environ
    start, stop = ("\033[31m", "\033[0m") if colour else ("", "")
    with suppress(OSError):
        print(f"{start}rearl: {message}{stop}", file=sys.stderr, flush=True)

"""Files that appear whole or not at all, whatever happens to the process that writes them, in folders that one process
at a time writes to.
"""

import logging
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from weakref import WeakValueDictionary

from filelock import FileLock, Timeout

log = logging.getLogger(__name__)

_claimed: WeakValueDictionary[Path, FileLock] = WeakValueDictionary()
"""Folders claimed by this process."""


class FolderInUseError(OSError):
    """Another process writes to the folder."""


def claim(folder: Path) -> FileLock | None:
    """Makes the folder this process's own for as long as the returned claim is kept, or the process lives.

    The operating system takes the claim back when the process ends, however it does. An empty file beside the folder,
    `.NAME.lock`, stays. None where the file system knows no locks: a warning is logged, and nothing is protected.

    Raises:
        FolderInUseError: Another process has claimed it.
    """
    folder = folder.resolve()
    if (own := _claimed.get(folder)) is not None:
        return own
    lock = FileLock(folder.with_name(f".{folder.name}.lock"), timeout=0, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        raise FolderInUseError(
            f"another process is writing to {folder}: wait until it has finished, or choose another folder with "
            "study=NAME"
        ) from None
    except NotImplementedError as error:
        log.warning("%s is not protected from other processes: %s", folder, error)
        return None
    _claimed[folder] = lock
    return lock


def private_folder(path: Path) -> None:
    """Makes the folder, for nobody but this user: what lies in it is run or believed without being looked at."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)


def is_private(path: Path) -> bool:
    """True where nobody else but root can write to an existing folder; True on systems that do not tell."""
    if not hasattr(os, "getuid"):
        return True
    found = path.stat()
    return found.st_uid in (os.getuid(), 0) and not found.st_mode & 0o002


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write to, which replaces `path` when the block ends well and vanishes when it does not.

    The folder is made. The new path has no ending of its own: name the format where a library would guess it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # In the same folder, since a rename is atomic only inside one file system.
    unfinished = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}.unfinished")
    try:
        yield unfinished
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def remove_leftovers(folder: Path) -> None:
    """Removes what processes of this machine that are no more had not finished writing."""
    for path in folder.rglob(f".*.{platform.node()}.*.unfinished"):
        number = path.name.split(".")[-2]
        if number.isdecimal() and not _is_alive(int(number)):
            path.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)  # no signal, only the question
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's process, or a system without such a question
        return True
    return True

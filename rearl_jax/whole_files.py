"""Atomic files and locked folders: a file appears complete or not at all, one process at a time writes to a folder."""

import errno
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
"""Locks that this process holds, by folder."""


class FolderInUseError(OSError):
    """Another process writes to the folder."""


def claim(folder: Path) -> FileLock | None:
    """Lock of the folder for this process, held until the returned object is deleted or the process ends.

    An empty file `.NAME.lock` remains beside the folder. On a file system without locks a warning is logged and None is
    returned: the folder is then not protected.

    Raises:
        FolderInUseError: Another process holds the lock.
    """
    folder = folder.resolve()
    if (held := _claimed.get(folder)) is not None:
        return held
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
    """Create a folder that only this user can access, for content that is loaded without verification."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)


def is_private(path: Path) -> bool:
    """True if a folder belongs to this user or root and other users cannot write to it; True without user ids."""
    if not hasattr(os, "getuid"):
        return True
    status = path.stat()
    return status.st_uid in (os.getuid(), 0) and not status.st_mode & 0o002


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Inside the block, errors of writing to an open file, as on a full disk, get the name of this file."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = str(path)
        raise


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Temporary path to write to; it replaces `path` if the block succeeds and is deleted if the block fails.

    The folder of `path` is created. The temporary path has another suffix, so a library that infers the format from the
    suffix needs the format stated. The content is on disk before it replaces `path`, so that a power failure leaves
    the old content or the new one.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # In the same folder, since a rename is atomic only inside one file system.
    unfinished = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}.unfinished")
    try:
        with naming(path):
            yield unfinished
            _store(unfinished)
            os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def remove_leftovers(folder: Path, *, below: bool = True) -> None:
    """Remove the unfinished files of processes of this machine that no longer run; `below` also in its folders."""
    pattern = f".*.{platform.node()}.*.unfinished"
    for path in folder.rglob(pattern) if below else folder.glob(pattern):
        pid = path.name.split(".")[-2]
        if pid.isdecimal() and not _is_alive(int(pid)):
            path.unlink(missing_ok=True)


def _store(path: Path) -> None:
    """Have the system write a file from memory to disk, where the file system can."""
    with path.open("r+b") as file:
        try:
            os.fsync(file.fileno())
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):
                raise


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)  # signal 0 only tests whether the process exists
    except ProcessLookupError:
        return False
    except OSError:  # a process of another user, or a system without this test
        return True
    return True

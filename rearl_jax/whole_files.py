"""Files that appear whole or not at all, whatever happens to the process that writes them. Standard library only."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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

"""Expensive results cached on disk: computed once per machine for the same data, configuration and code."""

import hashlib
import json
import logging
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rearl_jax.code_version import __version__, code_hash
from rearl_jax.runtime import cache_folder
from rearl_jax.whole_files import remove_leftovers, replacing

log = logging.getLogger(__name__)


def kept_folder(kind: str) -> Path:
    """Folder of one kind of cached results, beside the folder of compiled programs."""
    return cache_folder().parent / kind


def kept_path(kind: str, keys: Mapping[str, object], packages: tuple[str, ...], ending: str) -> Path:
    """File of the cached result with these keys, computed by this version of the code.

    Args:
        kind: Name of the folder.
        keys: Everything the result depends on besides the code.
        packages: Parts of rearl_jax whose source code the result depends on.
        ending: Suffix of the file's name.
    """
    text = json.dumps({**keys, "code": f"{__version__} {code_hash(packages)}"}, sort_keys=True, allow_nan=False)
    return kept_folder(kind) / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}{ending}"


def read_arrays(path: Path) -> dict[str, np.ndarray] | None:
    """The arrays stored there; None if there is no file or, with a warning, if it is damaged."""
    try:
        # Opened here, because NumPy does not close a file that it cannot read.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        log.warning("%s is damaged (%s): computed again", path, error)
        return None


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Stores the arrays whole or not at all; if the folder is not writable, the next run computes them again."""
    remove_leftovers(path.parent, below=False)
    try:
        with replacing(path) as unfinished, unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
    except OSError as error:
        log.warning("not stored for the next run: %s; set XDG_CACHE_HOME to another folder", error)

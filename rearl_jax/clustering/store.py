"""Finished clusterings on disk, so that the same data and configuration are clustered once per machine."""

import hashlib
import json
import logging
import os
import zipfile
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from rearl_jax import __version__
from rearl_jax.runtime import cache_folder

log = logging.getLogger(__name__)


def cluster_folder() -> Path:
    """The folder of finished clusterings, beside that of compiled programs."""
    return cache_folder().parent / "clusters"


def cache_path(keys: Mapping[str, object]) -> Path:
    """File of the clustering with these keys, made by this version of the code."""
    text = json.dumps({**keys, "code": _code_version()}, sort_keys=True, allow_nan=False)
    return cluster_folder() / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.npz"


def read_arrays(path: Path) -> dict[str, np.ndarray] | None:
    """The arrays stored there; None where there is no file, or, with a warning, where it is damaged."""
    try:
        # Opened here, as NumPy leaves a file open that it cannot read.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        log.warning("%s is damaged (%s): clustering again", path, error)
        return None


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Stores the arrays whole or not at all; a folder that cannot be written to only costs the next run its time."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.unfinished")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        os.replace(unfinished, path)
    except OSError as error:
        log.warning("the clustering is not kept: %s; set XDG_CACHE_HOME to another folder", error)
    finally:
        unfinished.unlink(missing_ok=True)


@cache
def _code_version() -> str:
    """Version of the package and a digest of the sources that decide a clustering, for checkouts in between."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256(__version__.encode())
    for folder in ("clustering", "config", "data"):
        for file in sorted((package / folder).glob("*.py")):
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()

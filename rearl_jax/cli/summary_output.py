"""`--json`: the summary of a finished task as the only thing on standard output."""

import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from rearl_jax.results import cell_folder, first_part, read_summary
from rearl_jax.tasks import Task


@contextmanager
def standard_output_apart() -> Iterator[TextIO]:
    """A stream to the original standard output; all other output inside the block goes to standard error.

    File descriptors are redirected, so that this includes the output of child processes and of compiled libraries.
    """
    sys.stdout.flush()
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as original:
        os.dup2(2, 1)
        try:
            yield original
        finally:
            sys.stdout.flush()
            original.flush()
            os.dup2(original.fileno(), 1)


def summary_object(task: Task, folder: Path | None, returned: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of a task: `task`, `results` (its folder), and the content of summary.json, a list as `rows`."""
    stored = None if folder is None else _read(folder)
    first = first_part(stored)
    if not isinstance(first, dict) or first.get("task") != task.words:
        content = dict(returned)
    else:
        content = stored if isinstance(stored, dict) else {"rows": stored}
    return {"task": task.words, "results": None if folder is None else str(folder)} | content


def multirun_object(task: Task, folder: Path, cells: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """The summary of a multirun: the combined one if the task writes it, else those of all finished jobs."""
    stored = _read(folder) if task.collect is not None else None
    if stored is None:
        stored = []
        for cell in cells:
            job_folder = cell_folder(folder, cell)
            summary = _read(job_folder)
            parts = summary if isinstance(summary, list) else [summary] if summary is not None else []
            stored += [{"results": str(job_folder), **cell, **part} for part in parts]
    return {"task": task.words, "results": str(folder), "rows": stored}


def write_object(value: Mapping[str, Any], stream: TextIO) -> None:
    """Writes one line of JSON; inf and nan, which JSON lacks, become null."""
    print(json.dumps(_plain(value), allow_nan=False), file=stream)


def _read(folder: Path) -> Any:
    """The content of the `summary.json` in a folder; None without a readable one."""
    try:
        return read_summary(folder)
    except (OSError, ValueError):
        return None


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # NumPy and JAX scalars
        value = value.item()
    if isinstance(value, float):
        return value if value - value == 0.0 else None  # the difference is NaN for inf and nan
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)

"""One task of `rearl`: its name, its description, its function and its configuration record.

Standard library only.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class Task:
    """One task, named `words` on the command line. `run`, `config`, `collect` and `on_file` are addresses
    `module:name`; the function `run` takes the configuration record.

    `collect` combines the cells (jobs) of a multirun: it takes the record common to all cells, and the values of the
    swept keys for each cell. `on_file` is the function for `rearl TASK FILE`, which takes the name of the file.
    `implied` maps groups of keys to overrides that they imply. `resumes` states that the same command resumes an
    interrupted task, `failures` names the figure in the function's result that makes `rearl` fail unless it is 0. With
    `x64` JAX computes in double precision; with `uses_jax=False` the task starts without the import of JAX.
    """

    words: str
    run: str
    config: str
    summary: str
    description: str
    examples: tuple[str, ...]
    x64: bool = False
    resumes: bool = False
    uses_jax: bool = True
    failures: str | None = None
    collect: str | None = None
    on_file: str | None = None
    implied: dict[str, str] = field(default_factory=dict)

    @property
    def config_name(self) -> str:
        """Name of the task's file in conf/ without its ending, `discover blind` -> `discover_blind`."""
        return self.words.replace(" ", "_")

    def load_config(self) -> type:
        """The class of the task's configuration record."""
        return _load(self.config)

    def defaults(self) -> Any:
        """The configuration record with every key at its default."""
        return self.load_config()()

    def load_run(self) -> Callable[[Any], dict]:
        """The function of the task; importing it imports JAX and whatever else the task needs."""
        return _load(self.run)

    def load_on_file(self) -> Callable[[str], dict]:
        """The function for a file that is named instead of keys."""
        assert self.on_file is not None
        return _load(self.on_file)

    def load_collect(self) -> Callable[[Any, list[dict[str, str]]], None]:
        """The function that combines cells."""
        assert self.collect is not None
        return _load(self.collect)


def _load(address: str) -> Any:
    module, _, name = address.partition(":")
    return getattr(import_module(module), name)

"""Keys of the results."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class FolderConfig:
    """Folder of the results"""

    root: str = key("results", "folder of all studies, relative to the current folder")

    def check(self) -> None:
        if not self.root:
            raise out_of_range("root", "must name a folder, or be . for the current one", repr(self.root))


@dataclass(unsafe_hash=True)
class ResultsConfig(FolderConfig):
    """Folder of the results"""

    resume: bool = key(
        False, "skip a finished study with the same configuration, data and code; jobs of a multirun always do"
    )

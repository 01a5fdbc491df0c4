"""Keys of the results."""

from dataclasses import dataclass

from rearl_jax.config._key import key


@dataclass(unsafe_hash=True)
class ResultsConfig:
    """Folder of the results"""

    root: str = key("results", "folder of all studies, relative to the current folder")
    resume: bool = key(
        False, "skip a finished study with the same configuration, data and code; jobs of a multirun always do"
    )

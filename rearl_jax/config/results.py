"""Keys of the results: where they are written."""

from dataclasses import dataclass

from rearl_jax.config._key import key


@dataclass(unsafe_hash=True)
class ResultsConfig:
    """Where results are written"""

    root: str = key("results", "folder of all studies; relative to the folder rearl is called from")
    resume: bool = key(
        False, "leave a finished study of the same configuration, data and code alone; jobs of a multirun always do"
    )

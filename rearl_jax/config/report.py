"""Configuration of the report on a finished study."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class FolderConfig:
    """Where results lie"""

    root: str = key("results", "folder of all studies; relative to the folder rearl is called from")


@dataclass(unsafe_hash=True)
class ReportConfig:
    """The file, and the scenes that are replayed in it"""

    path: str | None = key(
        None, "file to write, relative to the folder rearl is called from; null = report.html in the study's folder"
    )
    replay: bool = key(True, "simulate some scenes of `rearl evaluate` again and show them beside the recorded ones")
    n_scenes: int = key(3, "scenes that are replayed, spread evenly from the slowest to the fastest held-out one")
    scenes: tuple[int, ...] | None = key(None, "scene_id of the scenes that are replayed, e.g. [3,17]; null = n_scenes")
    run: int = key(0, "run of the study that is replayed, from 0")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if not 1 <= self.n_scenes <= 20:
            raise out_of_range("n_scenes", "must be within 1 and 20", self.n_scenes)
        if self.run < 0:
            raise out_of_range("run", "must be at least 0", self.run)
        if self.scenes is not None and (not self.scenes or len(set(self.scenes)) != len(self.scenes)):
            raise out_of_range("scenes", "must name each scene once", list(self.scenes))
        if self.path == "":
            said = "must name a file, or be null for report.html in the study's folder"
            raise out_of_range("path", said, repr(self.path))

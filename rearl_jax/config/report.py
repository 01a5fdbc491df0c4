"""Configuration of the report on a finished study."""

from dataclasses import dataclass

from rearl_jax.config._key import key


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
        """Raise ValueError for a value outside its range."""
        if not 1 <= self.n_scenes <= 20:
            raise ValueError(f"n_scenes must be within 1 and 20, got {self.n_scenes}")
        if self.run < 0:
            raise ValueError(f"run must be at least 0, got {self.run}")
        if self.scenes is not None and (not self.scenes or len(set(self.scenes)) != len(self.scenes)):
            raise ValueError(f"scenes must name each scene once, got {list(self.scenes)}")
        if self.path == "":
            raise ValueError("path must name a file, or be null for report.html in the study's folder")

"""Configuration of the report on a finished study."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least, check_within
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class ReportConfig:
    """File of the report, and replayed scenes"""

    path: str | None = key(
        None, "file to write, relative to the current folder; null = page.html in the folder of the study"
    )
    replay: bool = key(True, "replay scenes of `rearl evaluate` together with the recorded ones")
    n_scenes: int = key(3, "number of replayed scenes, spread evenly from the slowest to the fastest held-out scene")
    scenes: tuple[int, ...] | None = key(
        None, "scene_id of the replayed scenes, e.g. [3,17]; null = as n_scenes states"
    )
    run: int = key(0, "number of the replayed run, from 0")

    def check(self) -> None:
        check_within(self, 1, 20, "n_scenes")
        check_least(self, 0, "run")
        if self.scenes is not None and (not self.scenes or len(set(self.scenes)) != len(self.scenes)):
            raise out_of_range("scenes", "must name each scene once", list(self.scenes))
        if self.path == "":
            message = "must name a file, or be null for page.html in the study's folder"
            raise out_of_range("path", message, repr(self.path))

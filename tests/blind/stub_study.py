"""The blind study with a stub in the place of discovery, as a process of its own.

`python -m tests.blind.stub_study ROOT [DIE_AFTER]`: kills itself with SIGKILL inside that data set.
"""

import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

from rearl_jax.blind.task import run_with
from rearl_jax.config import DiscoverBlindTask, ResultsConfig
from rearl_jax.config.blind import BlindConfig


def task(root: Path, **blind) -> DiscoverBlindTask:
    """The small study with a master seed."""
    return DiscoverBlindTask("blind", ResultsConfig(str(root)), replace(BlindConfig(seed=11), **blind))


class Stub:
    """A stand-in that names an effect by the length of the first file, adds the weather to it, and logs its calls."""

    def __init__(self, log: Path, die_after: int | None = None, n_files: int = 1) -> None:
        self.log, self.die_after, self.n_files = log, die_after, n_files

    def __call__(self, folder: Path, study: str, oracle: str | None = None) -> dict:
        """A verdict that depends on the data only."""
        files = sorted(folder.iterdir())
        assert len(files) == self.n_files
        with self.log.open("a") as log:
            log.write(f"{folder.name} {oracle}\n")
        if self.die_after is not None and len(self.log.read_text().splitlines()) > self.die_after:
            os.kill(os.getpid(), signal.SIGKILL)
        name = ("grade", "reaction_delay", None)[files[0].stat().st_size % 3]
        said = () if name is None else ((name, "driver", 0.9), ("weather", "road", 0.5))
        effects = [{"name": name, "kind": kind, "parameters": {}, "confidence": sure} for name, kind, sure in said]
        change = {"value": -0.5, "low": -0.75, "high": -0.25}
        error = {"before": 3.0, "after": 2.0, "change": change, "floor": None, "oracle": 1.0 if oracle else None}
        return {
            "verdict": "named" if effects else "nothing", "effects": effects, "data": {}, "seconds": 0.1,
            "candidates": [{"name": "speed_limit", "ambiguous": True}],
            "error": error | {"measure": "m", "n_drivers": 36},
        }  # fmt: skip


if __name__ == "__main__":
    root = Path(sys.argv[1])
    run_with(task(root), Stub(root / "asked.txt", int(sys.argv[2]) if len(sys.argv) > 2 else None))

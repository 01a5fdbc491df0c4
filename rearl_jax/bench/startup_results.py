"""How long commands take to start, as a table, as flat figures, and with the figures' meanings."""

import json
from dataclasses import asdict, dataclass

import pandas as pd

from rearl_jax.bench.spread import Spread, spread_of, with_spread

COLD, WARM, IMPORT, PYTHON = "evaluate_cold", "evaluate_warm", "import_package", "python"

MEANINGS = {
    "{command}_first_s": "elapsed time to the first line of output, of an evaluation its table [s]; also _min, _max",
    "{command}_whole_s": "elapsed time of the whole command, median [s]",
    "{command}_cpu_s": "CPU time of the whole command, median [s]",
    "import_ms": "what `import rearl_jax` takes beyond the start of Python, medians [ms]",
    "cold_goal_s": "most that evaluate_cold_first_s should be",
    "warm_goal_s": "most that evaluate_warm_first_s should be",
    "load_average": "processes that wanted to run when the measurements began",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""


@dataclass(frozen=True)
class Start:
    """One start of a command.

    Attributes:
        command: Its name.
        repetition: Number of the measurement.
        first_s: Elapsed time to the first line of output [s].
        wall_s: Elapsed time to the end [s].
        cpu_s: CPU time to the end, with all it has started [s]; 0 where the system does not tell.
    """

    command: str
    repetition: int
    first_s: float
    wall_s: float
    cpu_s: float


@dataclass(frozen=True)
class StartupResults:
    """All starts, the goals, the load before the first and the machine."""

    starts: tuple[Start, ...]
    cold_goal_s: float
    warm_goal_s: float
    load_average: float | None
    machine: dict[str, str | int | float]

    @property
    def commands(self) -> list[str]:
        """Names of the commands, in the order in which they ran."""
        return list(dict.fromkeys(start.command for start in self.starts))

    def spread(self, command: str, figure: str) -> Spread:
        """A figure of a command over its repetitions."""
        return spread_of([getattr(start, figure) for start in self.starts if start.command == command])

    @property
    def import_ms(self) -> float:
        """What the import of the package takes beyond the start of Python [ms]."""
        with_it, without = (self.spread(command, "first_s").median for command in (IMPORT, PYTHON))
        return 1000 * (with_it - without)

    def table(self) -> pd.DataFrame:
        """One row per start."""
        return pd.DataFrame([asdict(start) for start in self.starts])

    def metadata(self) -> dict[str, str]:
        """What goes with the table."""
        return {"machine": json.dumps(self.machine)}

    def summary(self) -> dict:
        """Flat figures; `MEANINGS` says what they are."""
        figures: dict = {**self.machine, "load_average": self.load_average, "import_ms": self.import_ms}
        for command in self.commands:
            figures |= with_spread(f"{command}_first_s", self.spread(command, "first_s"))
            figures[f"{command}_whole_s"] = self.spread(command, "wall_s").median
            figures[f"{command}_cpu_s"] = self.spread(command, "cpu_s").median
        return figures | {"cold_goal_s": self.cold_goal_s, "warm_goal_s": self.warm_goal_s}

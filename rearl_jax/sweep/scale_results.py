"""Costs of a stream of rollouts, as figures that are printed, drawn and written."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rearl_jax.config import SweepScaleTask
from rearl_jax.sweep.parts import parts_of
from rearl_jax.sweep.scale_costs import BatchCost
from rearl_jax.sweep.scale_progress import StreamLog


@dataclass(frozen=True)
class ScaleResults:
    """Results of a stream of rollouts.

    Attributes:
        config: The task.
        n_scenes: Number of simulated scenes.
        seconds: Simulated time of a rollout [s].
        thresholds: Thresholds of the Hellinger distance and of the spacing error; infinite if nothing is detected.
        costs: Cost of a rollout by the number simulated at a time.
        stream: Simulated rollouts of this run, and their memory use.
        machine: Description of the machine.
        load_average: Processes that wanted to run when the task began; None if the system does not report it.
        generated: Whether the recordings were generated, not measured.
    """

    config: SweepScaleTask
    n_scenes: int
    seconds: int
    thresholds: tuple[float, float]
    costs: list[BatchCost]
    stream: StreamLog
    machine: Mapping[str, str | int | float]
    load_average: float | None
    generated: bool

    @property
    def n_rollouts(self) -> int:
        """Number of rollouts on disk, from this and earlier runs."""
        return int(self.config.n_rollouts)

    def rates(self) -> dict[str, float | None]:
        """Rollouts, vehicle-seconds and agent-substeps per second of elapsed and of CPU time; None if nothing was run.

        They only include rollouts simulated, scored and written in this run. An agent-substep is one vehicle in one
        tick.
        """
        core, stream = self.config.core, self.stream
        vehicle_seconds = core.n_vehicles * self.seconds
        units = {"rollouts": 1, "vehicle_seconds": vehicle_seconds, "substeps": vehicle_seconds * core.ticks_per_second}
        clocks = {"s": stream.wall_s, "cpu_s": stream.cpu_s}
        return {
            f"{name}_per_{clock}": stream.n_simulated * unit / time if stream.n_simulated else None
            for name, unit in units.items()
            for clock, time in clocks.items()
        }

    def memory(self) -> dict[str, float | None]:
        """Memory of the process after the first and after the last part simulated now [MiB]; None if it is not known.

        `peak_mib`: largest resident memory so far; `resident_mib`: present resident memory.
        """
        table = self.stream.this_session()
        figures: dict[str, float | None] = {}
        for name in ("peak_mib", "resident_mib"):
            for end, row in (("first_part", 0), ("last_part", -1)):
                value = float(table[name].iloc[row]) if len(table) else math.nan
                figures[f"{name}_{end}"] = value if math.isfinite(value) else None
        return figures

    def summary(self) -> dict[str, str | int | float | None]:
        """Flat figures for summary.json; those of a batch size end in `_n` and its number of rollouts."""
        threshold_h, threshold_m = (value if math.isfinite(value) else None for value in self.thresholds)
        figures: dict[str, str | int | float | None] = {
            "method": self.config.method.name,
            "n_rollouts": self.n_rollouts,
            "n_simulated": self.stream.n_simulated,
            "n_before": self.stream.n_before,
            "n_parts": len(parts_of(self.n_rollouts)),
            "n_scenes": self.n_scenes,
            "n_vehicles": self.config.core.n_vehicles,
            "rollout_seconds": self.seconds,
            "threshold_h": threshold_h,
            "threshold_m": threshold_m,
            "wall_s": self.stream.wall_s,
            "cpu_s": self.stream.cpu_s,
            **self.rates(),
            **self.memory(),
        }
        for cost in self.costs:
            for name in ("first_s", "simulate_s", "simulate_cpu_s", "score_s", "score_cpu_s"):
                figures[f"{name}_n{cost.n_rollouts}"] = getattr(cost, name)
        return figures | {**self.machine, "load_average": self.load_average}

"""Timed runs of programs, and the clocks and meters behind them."""

import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, median
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:
    from rearl_jax.core.rollout import Frames

TICKS_PER_SECOND = 15
"""Steps per simulated second. Source: highway-env 1.12.1."""


@dataclass(frozen=True)
class Spread:
    """Median, least and greatest value of a figure over the repetitions."""

    median: float
    least: float
    greatest: float

    def figures(self, name: str) -> dict[str, float]:
        """Median, least and greatest value, under the keys that a summary uses."""
        return {name: self.median, f"{name}_min": self.least, f"{name}_max": self.greatest}


def spread_of(values: Sequence[float]) -> Spread:
    """Spread of the values of the repetitions."""
    return Spread(median(values), min(values), max(values))


@dataclass(frozen=True)
class Measurement:
    """One run of a program: size, cost, and figures of the traffic.

    Attributes:
        n_scenarios: Scenarios simulated.
        seconds: Simulated time of each scenario [s].
        n_substeps: Vehicles times steps of 1/15 s, over all scenarios.
        cpu_s: CPU time of the stepping over all threads of the process [s].
        wall_s: Elapsed time of the stepping [s].
        mean_speed: Mean speed of all vehicles at the end [m/s].
        lane_changes: Lane changes detected between consecutive whole seconds; None if they are not reported.
        crashed: Vehicles that have collided by the end; None if the program has no collisions.
        peak_memory_bytes: Largest resident memory of the process so far; None if it is not reported.
    """

    n_scenarios: int
    seconds: int
    n_substeps: int
    cpu_s: float
    wall_s: float
    mean_speed: float
    lane_changes: int | None = None
    crashed: int | None = None
    peak_memory_bytes: int | None = None

    @property
    def substeps_per_cpu_s(self) -> float:
        """Agent-substeps (steps of one vehicle over 1/15 s) per second of CPU time [1/s]."""
        return self.n_substeps / self.cpu_s

    @property
    def substeps_per_s(self) -> float:
        """Agent-substeps per second of elapsed time [1/s]."""
        return self.n_substeps / self.wall_s


@dataclass(frozen=True)
class Series:
    """Repeated measurements of one program at one number of vehicles, and facts about the program."""

    program: str
    n_vehicles: int
    measurements: tuple[Measurement, ...]
    facts: Mapping[str, float | int]

    @property
    def substeps_per_cpu_s(self) -> float:
        """Agent-substeps per second of CPU time, median [1/s]."""
        return median(run.substeps_per_cpu_s for run in self.measurements)

    @property
    def substeps_per_s(self) -> float:
        """Agent-substeps per second of elapsed time, median [1/s]."""
        return median(run.substeps_per_s for run in self.measurements)

    @property
    def lane_changes_per_vehicle_min(self) -> float | None:
        """Lane changes per vehicle and minute [1/min]; None if they are not reported."""
        counts = [run.lane_changes for run in self.measurements if run.lane_changes is not None]
        # A change in the first second cannot be detected without an earlier second.
        minutes = sum(run.n_scenarios * self.n_vehicles * (run.seconds - 1) / 60 for run in self.measurements)
        return sum(counts) / minutes if counts and minutes else None

    @property
    def crashed_share(self) -> float | None:
        """Share of the vehicles that have collided by the end; None if the program has no collisions."""
        counts = [run.crashed for run in self.measurements if run.crashed is not None]
        n_agents = sum(run.n_scenarios * self.n_vehicles for run in self.measurements)
        return sum(counts) / n_agents if counts else None

    @property
    def mean_speed(self) -> float:
        """Mean speed at the end [m/s]."""
        return mean(run.mean_speed for run in self.measurements)


@runtime_checkable
class Simulator(Protocol):
    """A program prepared for scenes of one kind."""

    @property
    def facts(self) -> Mapping[str, float | int]:
        """`unit`, the number of scenarios that the program simulates at a time, and figures measured at the start."""
        ...

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of simulating `n_scenarios` scenes drawn from the seed."""
        ...


class Stopwatch:
    """CPU time of all threads of this process and elapsed time, summed over `with` blocks."""

    def __init__(self) -> None:
        self.cpu_s = 0.0
        self.wall_s = 0.0

    def __enter__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.cpu_s += time.process_time() - self._cpu
        self.wall_s += time.perf_counter() - self._wall


def measurement_of(
    chunks: "Iterable[Frames]", watch: Stopwatch, *, n_scenarios: int, n_vehicles: int, seconds: int
) -> Measurement:
    """Measurement of traffic of the core that is simulated chunk by chunk; the watch is read after the last chunk."""
    crashed = lane_changes = 0
    speed_sum = 0.0
    for frames in chunks:
        crashed += int(np.count_nonzero(frames.crashed[-1]))
        lane_changes += int(np.count_nonzero(np.diff(frames.lane, axis=0)))
        speed_sum += float(np.sum(frames.speed[-1], dtype=np.float64))
    n_agents = n_scenarios * n_vehicles
    return Measurement(
        n_scenarios=n_scenarios,
        seconds=seconds,
        n_substeps=n_agents * seconds * TICKS_PER_SECOND,
        cpu_s=watch.cpu_s,
        wall_s=watch.wall_s,
        mean_speed=speed_sum / n_agents,
        lane_changes=lane_changes,
        crashed=crashed,
        peak_memory_bytes=peak_memory_bytes(),
    )


def peak_memory_bytes() -> int | None:
    """Largest resident memory this process has had so far [bytes]; None if the system does not report it."""
    if sys.platform == "linux":
        # getrusage would include memory of the parent process at the start of this process.
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024

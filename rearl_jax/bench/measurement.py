"""One timed run of one program, and the clocks and meters behind it."""

import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:
    from rearl_jax.core.rollout import Frames

TICKS_PER_SECOND = 15
"""Steps per simulated second. Source: highway-env 1.12.1."""


@dataclass(frozen=True)
class Measurement:
    """What one run simulated, what it cost, and what happened in the traffic.

    Attributes:
        n_scenarios: Scenarios simulated.
        seconds: Simulated time of each of them [s].
        n_substeps: Steps of 1/15 s times vehicles, over all scenarios.
        cpu_s: CPU time of the stepping over all threads of the process [s].
        wall_s: Elapsed time of the stepping [s].
        mean_speed: Mean speed of all vehicles at the end [m/s].
        lane_changes: Changes of lane seen between whole seconds; None where they are not reported.
        crashed: Vehicles that have collided by the end; None where the program has no collisions.
        peak_memory_bytes: Largest resident memory of the process so far; None for the peers.
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
        """Agent-substeps per second of CPU time [1/s]."""
        return self.n_substeps / self.cpu_s

    @property
    def substeps_per_s(self) -> float:
        """Agent-substeps per second of elapsed time [1/s]."""
        return self.n_substeps / self.wall_s


@runtime_checkable
class Simulator(Protocol):
    """A program that has been made ready for scenes of one kind."""

    @property
    def facts(self) -> Mapping[str, float | int]:
        """`unit`, the least sensible number of scenarios, and figures found while starting."""
        ...

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of simulating so many scenes drawn from the seed."""
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


def take_stock(
    chunks: "Iterable[Frames]", watch: Stopwatch, *, n_scenarios: int, n_vehicles: int, seconds: int
) -> Measurement:
    """What our own core simulated, chunk by chunk, and what the watch says when the last chunk is there.

    Args:
        chunks: Frames as NumPy arrays; the watch runs while one is made.
        watch: Measures.
        n_scenarios: Scenarios in all chunks.
        n_vehicles: Vehicles per scenario.
        seconds: Simulated time [s].
    """
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
    """Largest resident memory this process has had so far [bytes]; None where the system does not tell."""
    if sys.platform == "linux":
        # getrusage would count what the parent process held at the moment it started this one.
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024

"""Measurements of the core as a table and as flat figures, and their comparison with an earlier benchmark."""

import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from benchmarks.options import Peer
from benchmarks.programs import BY_ELAPSED_TIME, OURS, Absent
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem
from rearl_jax.timing.measurement import Measurement, Series, Spread, spread_of

_REMEDY = "name the summary.json of a finished `python -m benchmarks core study=NAME`"

MEANINGS = {
    "substeps_per_cpu_s_n{N}": "vehicle steps of 1/15 s of the core per second of CPU time over all threads, median",
    "substeps_per_s_n{N}": "the same per elapsed second with all cores",
    "{peer}_substeps_per_cpu_s_n{N}": "peers: c (one thread), c_all_threads, highway_env, libsumo, highjax, gpu",
    "{peer}_substeps_per_s_n{N}": "the same per elapsed second",
    "ratio_to_{peer}_n{N}": "speed per CPU-second divided by the peer's, median of repetitions; also _min, _max",
    "ratio_to_c_all_threads_n{N}": "the same per elapsed second, both programs on all cores; likewise ratio_to_gpu",
    "cost_ratio_n{B}_to_n{A}": "CPU time per vehicle step with the most vehicles (B) divided by that with fewer (A)",
    "compile_s_n{N}": "elapsed time of compiling: first call less second call [s], without cache",
    "scenarios_n{N}": "scenarios of one measurement of the core",
    "chunk_n{N}": "scenarios a core takes at a time",
    "lane_changes_per_vehicle_min_n{N}": "lane changes in the core per vehicle and minute, at whole seconds",
    "crashed_share_n{N}": "share of the core's vehicles that have collided by the end",
    "mean_speed_n{N}": "mean speed of the core's vehicles at the end [m/s]",
    "peak_memory_gib_{R}": "peak resident memory of a new process with R rollouts [GiB]",
    "memory_run_s_{R}": "elapsed time of those rollouts, without compiling [s]",
    "substeps_per_cpu_s_chunk{C}": "vehicle steps per second of CPU time on one CPU core, C scenarios at a time",
    "substeps_per_s_threads{T}": "vehicle steps per elapsed second on T CPU cores",
    "gpu_speed_error_n{N}": "difference of the mean speed at the end on GPU and CPU, same scenes [m/s]",
    "gpu_lane_changes_error_n{N}": "difference of the lane changes on GPU and CPU, same scenes, relative to the CPU",
    "gpu_crashed_error_n{N}": "difference of the crashed vehicles on GPU and CPU, same scenes, divided by all vehicles",
    "n_slower": "numbers of vehicles at which the core is slower than in the earlier benchmark; 0 without one",
    "change_n{N}": "ratio to the reference program divided by the earlier one; also _min, _max over all pairs",
    "load_average": "processes that wanted to run when the measurements began",
    "absent": "peers that could not be measured: program, reason, remedy",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""


@dataclass(frozen=True)
class Agreement:
    """Measurements of the same scenes on the CPU and on a GPU."""

    n_vehicles: int
    cpu: Measurement
    gpu: Measurement

    def figures(self) -> dict[str, float]:
        """Differences under the keys of the summary."""
        n, cpu, gpu = self.n_vehicles, self.cpu, self.gpu
        changes, crashed = (cpu.lane_changes or 0, gpu.lane_changes or 0), (cpu.crashed or 0, gpu.crashed or 0)
        return {
            f"gpu_speed_error_n{n}": abs(gpu.mean_speed - cpu.mean_speed),
            f"gpu_lane_changes_error_n{n}": abs(changes[1] - changes[0]) / max(changes[0], 1),
            f"gpu_crashed_error_n{n}": abs(crashed[1] - crashed[0]) / (n * cpu.n_scenarios),
        }


@dataclass(frozen=True)
class Change:
    """Ratio of our speed to that of the reference program, in an earlier benchmark and now, at one number of vehicles.

    Times of different runs cannot be compared, because the load of the machine differs. Ratios to a program measured in
    turn with ours can.

    Attributes:
        n_vehicles: Vehicles per scenario.
        then: The ratio in the earlier benchmark.
        now: The ratio now.
        margin: Share of the earlier ratio that may be lost.
    """

    n_vehicles: int
    then: Spread
    now: Spread
    margin: float

    @property
    def factor(self) -> Spread:
        """Ratio now divided by ratio then; the range covers every pair of repetitions."""
        then, now = self.then, self.now
        return Spread(now.median / then.median, now.least / then.greatest, now.greatest / then.least)

    @property
    def is_slower(self) -> bool:
        """True if more than the margin was lost and no repetition reached the earlier median."""
        return self.factor.median < 1 - self.margin and self.now.greatest < self.then.median


def read_ratios(file: str, reference: Peer) -> dict[int, Spread]:
    """Ratios of our speed to the reference program's in an earlier benchmark's summary.json, by number of vehicles.

    Raises:
        MissingInputError: There is no such file.
        InvalidInputError: It is not a summary of the core's benchmark, or the reference program was absent.
    """
    path = Path(file) / "summary.json" if Path(file).is_dir() else Path(file)
    if not path.is_file():
        raise MissingInputError(Problem("file-missing", "is not there", _REMEDY, file=str(path), key="bench.against"))
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        stored = None
    if not isinstance(stored, dict) or stored.get("task") != "bench core":
        fault = "was not written by `python -m benchmarks core`"
        raise InvalidInputError(Problem("benchmark-unreadable", fault, _REMEDY, file=str(path), key="bench.against"))
    numbers = [int(key[1]) for name in stored if (key := re.fullmatch(rf"ratio_to_{reference.name}_n(\d+)", name))]
    if not numbers:
        fault = "must be a program that the earlier benchmark has a ratio to"
        problem = Problem("reference-absent", fault, file=str(path), key="bench.reference", value=reference.name)
        raise InvalidInputError(problem)
    names = {n: f"ratio_to_{reference.name}_n{n}" for n in numbers}
    return {n: Spread(*(float(stored[name + end]) for end in ("", "_min", "_max"))) for n, name in names.items()}


@dataclass(frozen=True)
class CoreResults:
    """All measurements.

    Attributes:
        series: Series of every program at every number of vehicles.
        absent: Programs that could not be measured.
        memory: Measurement of many rollouts in a new process; None if it was left out.
        load_average: Load average of the machine before the start; None if it is not reported.
        machine: Description of the machine.
        by_chunk: Series of our core on one core of the machine, one per number of scenarios at a time.
        by_threads: Series of our core, one per number of cores.
        agreements: Comparisons of CPU and GPU on the same scenes.
        changes: Changes of the ratio to the reference program since an earlier benchmark.
    """

    series: tuple[Series, ...]
    absent: tuple[Absent, ...]
    memory: Measurement | None
    load_average: float | None
    machine: dict[str, str | int | float]
    by_chunk: tuple[Series, ...] = ()
    by_threads: tuple[Series, ...] = ()
    agreements: tuple[Agreement, ...] = ()
    changes: tuple[Change, ...] = ()

    @property
    def numbers(self) -> list[int]:
        """The numbers of vehicles, rising."""
        return sorted({series.n_vehicles for series in self.series})

    @property
    def programs(self) -> list[str]:
        """The programs measured, ours first."""
        return list(dict.fromkeys(series.program for series in self.series))

    def find(self, program: str, n_vehicles: int) -> Series | None:
        """The series of a program at a number of vehicles."""
        return next((item for item in self.series if (item.program, item.n_vehicles) == (program, n_vehicles)), None)

    def ratio(self, peer: str, n_vehicles: int) -> Spread | None:
        """Ratio of our speed to the peer's within each repetition; by elapsed time if both use all cores."""
        ours, other = self.find(OURS, n_vehicles), self.find(peer, n_vehicles)
        if ours is None or other is None:
            return None
        speed = "substeps_per_s" if peer in BY_ELAPSED_TIME else "substeps_per_cpu_s"
        pairs = zip(ours.measurements, other.measurements, strict=True)
        ratios = [getattr(ours_run, speed) / getattr(peer_run, speed) for ours_run, peer_run in pairs]
        return spread_of(ratios)

    def cost_growth(self) -> dict[int, float]:
        """Our CPU time per vehicle step at the most vehicles divided by that at every smaller number; medians."""
        *fewer, most = self.numbers
        largest = self.find(OURS, most)
        if largest is None:
            return {}
        ours = {few: series for few in fewer if (series := self.find(OURS, few)) is not None}
        return {few: series.substeps_per_cpu_s / largest.substeps_per_cpu_s for few, series in ours.items()}

    def table(self) -> pd.DataFrame:
        """One row per program, number of vehicles and repetition; `varied` is vehicles, chunk or threads."""
        varied = (("vehicles", self.series), ("chunk", self.by_chunk), ("threads", self.by_threads))
        rows = [
            {
                "varied": what,
                "program": item.program,
                "n_vehicles": item.n_vehicles,
                "repetition": repetition,
                **asdict(measurement),
                "substeps_per_cpu_s": measurement.substeps_per_cpu_s,
                "substeps_per_s": measurement.substeps_per_s,
                "chunk": item.facts.get("chunk"),
                "threads": item.facts.get("threads"),
                "compile_s": item.facts.get("compile_s"),
            }
            for what, several in varied
            for item in several
            for repetition, measurement in enumerate(item.measurements)
        ]
        counts = ("lane_changes", "crashed", "peak_memory_bytes", "chunk", "threads")
        return pd.DataFrame(rows).astype({**dict.fromkeys(counts, "Int64"), "compile_s": "float64"})

    def metadata(self) -> dict[str, str]:
        """Metadata of the table."""
        absent = {item.program: item.reason for item in self.absent}
        return {"machine": json.dumps(self.machine), "absent": json.dumps(absent)}

    def summary(self) -> dict:
        """Flat figures; `MEANINGS` says what they are."""
        figures: dict = {**self.machine, "load_average": self.load_average}
        for n_vehicles in self.numbers:
            figures |= self._figures_of(n_vehicles)
        figures |= self.extra_figures()
        figures |= {f"substeps_per_cpu_s_chunk{item.facts['chunk']}": item.substeps_per_cpu_s for item in self.by_chunk}
        figures |= {f"substeps_per_s_threads{item.facts['threads']}": item.substeps_per_s for item in self.by_threads}
        for change in self.changes:
            figures |= change.factor.figures(f"change_n{change.n_vehicles}")
        figures["n_slower"] = sum(change.is_slower for change in self.changes)
        figures["absent"] = [asdict(item) for item in self.absent]
        return figures

    def _figures_of(self, n_vehicles: int) -> dict[str, float | int | None]:
        figures: dict[str, float | int | None] = {}
        for program in self.programs:
            item = self.find(program, n_vehicles)
            if item is None:
                continue
            owner = "" if program == OURS else f"{program}_"
            figures[f"{owner}substeps_per_cpu_s_n{n_vehicles}"] = item.substeps_per_cpu_s
            figures[f"{owner}substeps_per_s_n{n_vehicles}"] = item.substeps_per_s
            if program == OURS:
                figures[f"compile_s_n{n_vehicles}"] = item.facts["compile_s"]
                figures[f"chunk_n{n_vehicles}"] = item.facts["chunk"]
                figures[f"scenarios_n{n_vehicles}"] = item.measurements[0].n_scenarios
                figures[f"lane_changes_per_vehicle_min_n{n_vehicles}"] = item.lane_changes_per_vehicle_min
                figures[f"crashed_share_n{n_vehicles}"] = item.crashed_share
                figures[f"mean_speed_n{n_vehicles}"] = item.mean_speed
            elif (ratio := self.ratio(program, n_vehicles)) is not None:
                figures |= ratio.figures(f"ratio_to_{program}_n{n_vehicles}")
        return figures

    def extra_figures(self) -> dict[str, float | None]:
        """Growth of our cost with the number of vehicles, memory, agreement of GPU and CPU."""
        most = self.numbers[-1]
        figures: dict[str, float | None] = {
            f"cost_ratio_n{most}_to_n{few}": growth for few, growth in self.cost_growth().items()
        }
        if self.memory is not None:
            count, peak = self.memory.n_scenarios, self.memory.peak_memory_bytes
            label = f"{count // 1000}k" if count % 1000 == 0 else str(count)
            figures[f"peak_memory_gib_{label}"] = None if peak is None else peak / 2**30
            figures[f"memory_run_s_{label}"] = self.memory.wall_s
        for agreement in self.agreements:
            figures |= agreement.figures()
        return figures

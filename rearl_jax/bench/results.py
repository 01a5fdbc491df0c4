"""What was measured, as a table, as flat figures, and with the figures' meanings."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from statistics import mean, median

import pandas as pd

from rearl_jax.bench.earlier import Change
from rearl_jax.bench.measurement import Measurement
from rearl_jax.bench.native import MachineLimits
from rearl_jax.bench.rollouts import LeastWork
from rearl_jax.bench.sessions import BY_ELAPSED_TIME, OURS, Absent
from rearl_jax.bench.spread import Spread, spread_of, with_spread

MEANINGS = {
    "substeps_per_cpu_s_n{N}": "our vehicle steps of 1/15 s per second of CPU time over all threads, median",
    "substeps_per_s_n{N}": "the same per elapsed second with all cores",
    "{peer}_substeps_per_cpu_s_n{N}": "the peers: c (one thread), c_all_threads, highway_env, libsumo, highjax, gpu",
    "{peer}_substeps_per_s_n{N}": "the same per elapsed second",
    "ratio_to_{peer}_n{N}": "our speed by the peer's per CPU-second, median of repetitions; also _min, _max",
    "ratio_to_c_all_threads_n{N}": "the same per elapsed second, both programs on all cores; likewise ratio_to_gpu",
    "cost_ratio_n{B}_to_n{A}": "our CPU time per vehicle step at the most vehicles by that at each fewer number",
    "compile_s_n{N}": "elapsed time of the first call less that of the second [s], without cache",
    "scenarios_n{N}": "scenarios of one measurement of ours",
    "chunk_n{N}": "scenarios a core takes at a time",
    "lane_changes_per_vehicle_min_n{N}": "our lane changes per vehicle and minute, at whole seconds",
    "crashed_share_n{N}": "our vehicles that have collided by the end, of all",
    "mean_speed_n{N}": "our vehicles' mean speed at the end [m/s]",
    "peak_memory_gib_{R}": "resident memory at its peak of a fresh process with R rollouts [GiB]",
    "memory_run_s_{R}": "elapsed time of those rollouts, without compiling [s]",
    "substeps_per_cpu_s_chunk{C}": "our vehicle steps per second of CPU time on one core, by scenarios at a time",
    "substeps_per_s_threads{T}": "our vehicle steps per elapsed second, by cores",
    "memory_gb_per_s_t{T}": "what this many threads move to and from memory, STREAM's triad, best pass [10^9 bytes/s]",
    "gflops_t{T}": "what this many threads compute in float32, fused multiply-adds, best pass [10^9/s]",
    "memory_limit_ns_n{N}": "time a core needs to read and write the state of a vehicle once in memory [ns]",
    "arithmetic_limit_ns_n{N}": "time a core at its best needs for what no vehicle step can do without [ns]",
    "gpu_speed_error_n{N}": "difference of the mean speed at the end on GPU and CPU, same scenes [m/s]",
    "gpu_lane_changes_error_n{N}": "difference of the lane changes on GPU and CPU, same scenes, by those on the CPU",
    "gpu_crashed_error_n{N}": "difference of the crashed vehicles on GPU and CPU, same scenes, by all vehicles",
    "n_slower": "numbers of vehicles at which we are slower than in the earlier benchmark; 0 where there is none",
    "change_n{N}": "ratio to the reference program by the earlier one; also _min, _max, from all pairs of repetitions",
    "load_average": "processes that wanted to run when the measurements began",
    "absent": "peers that are not here: program, reason, remedy",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""


@dataclass(frozen=True)
class Series:
    """The repetitions of one program at one number of vehicles, and the facts of the program."""

    program: str
    n_vehicles: int
    measurements: tuple[Measurement, ...]
    facts: dict[str, float | int]

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
        """Lane changes per vehicle and minute [1/min]; None where they are not reported."""
        counts = [run.lane_changes for run in self.measurements if run.lane_changes is not None]
        # A change in the first second has no earlier second to be seen against.
        minutes = sum(run.n_scenarios * self.n_vehicles * (run.seconds - 1) / 60 for run in self.measurements)
        return sum(counts) / minutes if counts and minutes else None

    @property
    def crashed_share(self) -> float | None:
        """Vehicles that have collided by the end, of all; None where nobody can."""
        counts = [run.crashed for run in self.measurements if run.crashed is not None]
        n_agents = sum(run.n_scenarios * self.n_vehicles for run in self.measurements)
        return sum(counts) / n_agents if counts else None

    @property
    def mean_speed(self) -> float:
        """Mean speed at the end [m/s]."""
        return mean(run.mean_speed for run in self.measurements)


@dataclass(frozen=True)
class Agreement:
    """The same scenes on the CPU and on a GPU."""

    n_vehicles: int
    cpu: Measurement
    gpu: Measurement

    def figures(self) -> dict[str, float]:
        """What differs, under the keys of the summary."""
        n, cpu, gpu = self.n_vehicles, self.cpu, self.gpu
        changes, crashed = (cpu.lane_changes or 0, gpu.lane_changes or 0), (cpu.crashed or 0, gpu.crashed or 0)
        return {
            f"gpu_speed_error_n{n}": abs(gpu.mean_speed - cpu.mean_speed),
            f"gpu_lane_changes_error_n{n}": abs(changes[1] - changes[0]) / max(changes[0], 1),
            f"gpu_crashed_error_n{n}": abs(crashed[1] - crashed[0]) / (n * cpu.n_scenarios),
        }


@dataclass(frozen=True)
class BenchResults:
    """What was measured.

    Attributes:
        series: By number of vehicles, all programs.
        absent: Programs that are not here.
        memory: Many rollouts in a fresh process; None where it was left out.
        load_average: Before the start.
        machine: Its description.
        by_chunk: Ours on one core, by scenarios at a time.
        by_threads: Ours by number of cores.
        limits: What the machine can do, by number of threads.
        work: What a vehicle step cannot do without, by number of vehicles.
        agreements: CPU and GPU on the same scenes.
        changes: Since an earlier benchmark.
    """

    series: tuple[Series, ...]
    absent: tuple[Absent, ...]
    memory: Measurement | None
    load_average: float | None
    machine: dict[str, str | int | float]
    by_chunk: tuple[Series, ...] = ()
    by_threads: tuple[Series, ...] = ()
    limits: tuple[MachineLimits, ...] = ()
    work: Mapping[int, LeastWork] = field(default_factory=dict)
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
        wanted = (program, n_vehicles)
        return next((item for item in self.series if (item.program, item.n_vehicles) == wanted), None)

    def ratio(self, peer: str, n_vehicles: int) -> Spread | None:
        """Our speed by the peer's, taken within each repetition; by elapsed time where both use all cores."""
        ours, other = self.find(OURS, n_vehicles), self.find(peer, n_vehicles)
        if ours is None or other is None:
            return None
        speed = "substeps_per_s" if peer in BY_ELAPSED_TIME else "substeps_per_cpu_s"
        pairs = zip(ours.measurements, other.measurements, strict=True)
        ratios = [getattr(mine, speed) / getattr(theirs, speed) for mine, theirs in pairs]
        return spread_of(ratios)

    def cost_growth(self) -> dict[int, float]:
        """Our CPU time per vehicle step at the largest number of vehicles by that at every smaller one, medians."""
        *fewer, most = self.numbers
        largest = self.find(OURS, most)
        if largest is None:
            return {}
        ours = {few: series for few in fewer if (series := self.find(OURS, few)) is not None}
        return {few: series.substeps_per_cpu_s / largest.substeps_per_cpu_s for few, series in ours.items()}

    def limit_ns(self, n_vehicles: int) -> tuple[float, float] | None:
        """Least time of a vehicle step on one core, by memory and by arithmetic [ns]; None where it is not known."""
        if not self.limits or n_vehicles not in self.work:
            return None
        work, one = self.work[n_vehicles], self.limits[0]
        return 1e9 * work.n_bytes / one.bytes_per_s, 1e9 * work.n_operations / one.operations_per_s

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
        """What goes with the table."""
        absent = {item.program: item.reason for item in self.absent}
        return {"machine": json.dumps(self.machine), "absent": json.dumps(absent)}

    def summary(self) -> dict:
        """Flat figures; `MEANINGS` says what they are."""
        figures: dict = {**self.machine, "load_average": self.load_average}
        for n_vehicles in self.numbers:
            figures |= self._figures_of(n_vehicles)
        figures |= {f"cost_ratio_n{self.numbers[-1]}_to_n{few}": growth for few, growth in self.cost_growth().items()}
        if self.memory is not None:
            figures[f"peak_memory_gib_{self.memory_label()}"] = self.peak_memory_gib()
            figures[f"memory_run_s_{self.memory_label()}"] = self.memory.wall_s
        figures |= {f"substeps_per_cpu_s_chunk{item.facts['chunk']}": item.substeps_per_cpu_s for item in self.by_chunk}
        figures |= {f"substeps_per_s_threads{item.facts['threads']}": item.substeps_per_s for item in self.by_threads}
        for limit in self.limits:
            figures[f"memory_gb_per_s_t{limit.threads}"] = limit.bytes_per_s / 1e9
            figures[f"gflops_t{limit.threads}"] = limit.operations_per_s / 1e9
        for agreement in self.agreements:
            figures |= agreement.figures()
        for change in self.changes:
            figures |= with_spread(f"change_n{change.n_vehicles}", change.factor)
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
                figures |= with_spread(f"ratio_to_{program}_n{n_vehicles}", ratio)
        if (limit := self.limit_ns(n_vehicles)) is not None:
            figures[f"memory_limit_ns_n{n_vehicles}"], figures[f"arithmetic_limit_ns_n{n_vehicles}"] = limit
        return figures

    def memory_label(self) -> str:
        """The number of rollouts of the memory run, thousands as k."""
        count = 0 if self.memory is None else self.memory.n_scenarios
        return f"{count // 1000}k" if count and count % 1000 == 0 else str(count)

    def peak_memory_gib(self) -> float | None:
        """Peak of the memory run [GiB]."""
        peak = None if self.memory is None else self.memory.peak_memory_bytes
        return None if peak is None else peak / 2**30

"""Configuration keys of the benchmarks with their defaults, one record per benchmark."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config import ResultsConfig
from rearl_jax.config._key import group_key, key, study_key
from rearl_jax.config._ranges import check_least, check_positive, check_rising
from rearl_jax.config.study import StepsConfig
from rearl_jax.problems import out_of_range


class Peer(Enum):
    """A program the traffic core is measured against."""

    c = "c"
    """The C program beside the benchmark, without collisions."""
    highway_env = "highway_env"
    libsumo = "libsumo"
    highjax = "highjax"
    gpu = "gpu"
    """The traffic core on a GPU, if JAX finds one."""


@dataclass(unsafe_hash=True)
class CoreOptions:
    """Vehicles, repetitions and programs of the core's benchmark"""

    vehicles: tuple[int, ...] = key((2, 10, 30, 100, 300, 1000), "vehicles per scenario, each measured")
    seconds: int = key(60, "simulated time of a rollout [s]; REARL (Bi et al.)")
    density: float = key(2.0, "vehicles_density of the initial scenes [-]; highway-env, REARL (Bi et al.)")
    seed: int = key(0, "seed of the initial scenes; every repetition draws new ones")
    repetitions: int = key(5, "measurements of every program, taken in turn")
    repetition_cpu_s: float = key(2.0, "CPU time of a measurement, from which its number of scenarios is chosen [s]")
    scenarios: tuple[int, ...] | None = key(
        None,
        "scenarios of a measurement of ours, one number per entry of vehicles; null: as many as fill repetition_cpu_s",
    )
    chunk: int | None = key(None, "scenarios a core simulates at a time; null: by the number of vehicles")
    peers: tuple[Peer, ...] = key(tuple(Peer), "programs measured beside ours; absent ones are named")
    peer_cpu_s: float = key(
        3.0, "CPU time after which highway-env and HighJax end their scenes with the second they are in [s]"
    )
    varied_vehicles: int = key(10, "vehicles per scenario where chunk and threads are varied")
    chunks: tuple[int, ...] = key(
        (16, 144, 400, 1200, 4080), "scenarios a core takes at a time, each measured on one core; empty leaves them out"
    )
    threads: tuple[int, ...] | None = key(
        None, "cores, each number measured; null: 1, 2, 4 ... and all there are, empty leaves them out"
    )
    memory_rollouts: int = key(100_000, "rollouts of the peak-memory measurement; 0 leaves it out")
    memory_vehicles: int = key(10, "vehicles per scenario of the peak-memory measurement")
    against: str | None = key(
        None,
        "summary.json of an earlier `python -m benchmarks core`, or its folder; exit code 1 where we are slower now",
    )
    reference: Peer = key(Peer.c, "program whose ratio to ours is compared with the earlier ratio")
    margin: float = key(0.15, "share of the earlier ratio that may be lost")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        check_rising(self, "vehicles")
        for name in ("chunks", "threads"):
            if getattr(self, name):
                check_rising(self, name)
        check_least(self, 1, "seconds", "repetitions", "memory_vehicles", "varied_vehicles", "chunk")
        check_positive(self, "density", "repetition_cpu_s", "peer_cpu_s")
        check_least(self, 0, "seed", "memory_rollouts")
        if not 0 < self.margin < 1:
            raise out_of_range("margin", "must be between 0 and 1", self.margin)
        if self.against is not None and self.reference not in self.peers:
            fault = "must be one of peers: add it there, or choose another"
            raise out_of_range("reference", fault, self.reference.name)
        if self.scenarios is not None and (len(self.scenarios) != len(self.vehicles) or min(self.scenarios) < 1):
            fault = f"must hold one positive number for each of the {len(self.vehicles)} entries of vehicles"
            raise out_of_range("scenarios", fault, list(self.scenarios))
        if len(set(self.peers)) != len(self.peers):
            raise out_of_range("peers", "must name each program once", [peer.name for peer in self.peers])


class LoopPolicy(Enum):
    """A policy whose closed loop is measured."""

    rank = "rank"
    """The matcher, by order of speed and spacing."""
    raw = "raw"
    """The matcher, by speed and spacing themselves."""
    idle = "idle"
    """Keeps lane and target speed."""


@dataclass(unsafe_hash=True)
class LoopOptions(StepsConfig):
    """Detection and decisions beside the traffic core"""

    vehicles: tuple[int, ...] = key((10, 30), "vehicles per scenario, each measured")
    batches: tuple[int, ...] = key(
        (1, 16, 256, 1200), "scenarios simulated at a time on one core, each measured; empty leaves rollouts out"
    )
    policies: tuple[LoopPolicy, ...] = key(
        (LoopPolicy.rank, LoopPolicy.raw, LoopPolicy.idle),
        "policies of the measured closed loops: matcher by rank, matcher by raw values, idle",
    )
    seconds: int = key(60, "simulated time of a rollout [s]; REARL (Bi et al.)")
    repetitions: int = key(5, "measurements of every program, taken in turn")
    repetition_cpu_s: float = key(
        0.5, "CPU time of a measurement of Base, from which the number of batches of all programs is chosen [s]"
    )
    rounds: int | None = key(None, "batches of a measurement; null: as many as fill repetition_cpu_s")
    effects: tuple[str, ...] | None = key(
        None,
        "effects switched on one at a time, with the fewest vehicles and the largest batch; null: all, empty: none",
    )

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        super().check()
        check_rising(self, "vehicles")
        if self.batches:
            check_rising(self, "batches")
        if not (self.batches or self.steps_batches):
            fault = "must name the scenarios at a time, or steps_batches must"
            raise out_of_range("batches", fault, list(self.batches))
        check_least(self, 1, "seconds", "repetitions", "rounds")
        check_positive(self, "repetition_cpu_s")
        if self.vehicles[0] < 2:
            raise out_of_range("vehicles", "must be at least 2 each (a spacing needs two)", list(self.vehicles))
        if not self.policies or len(set(self.policies)) != len(self.policies):
            raise out_of_range("policies", "must name each policy once", [policy.name for policy in self.policies])
        if self.reference_seconds < self.seconds:
            fault = f"must be at least seconds ({self.seconds})"
            raise out_of_range("reference_seconds", fault, self.reference_seconds)


@dataclass(unsafe_hash=True)
class DiscoverOptions:
    """Sizes of the data in which discovery looks for a hidden reaction delay"""

    drivers: tuple[int, ...] = key((30, 60, 120, 240), "drivers that follow a leader, each number measured")
    seconds: tuple[int, ...] = key(
        (60, 240), "recorded time at 10 frames per second [s], each measured with every number of drivers"
    )
    replicates: int = key(30, "drives simulated by the calibrated model, with nothing missing, as discover.replicates")
    seed: int = key(0, "seed of the generated recordings and of discovery")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        check_rising(self, "drivers", "seconds")
        check_least(self, 2, "replicates")
        check_least(self, 0, "seed")
        if self.drivers[0] < 9:
            fault = "must be at least 9 each, three for each part of the data"
            raise out_of_range("drivers", fault, list(self.drivers))


@dataclass(unsafe_hash=True)
class ReadersOptions:
    """Files of recordings that are written and read"""

    layouts: tuple[str, ...] | None = key(None, "layouts, each measured; null: all")
    megabytes: float = key(200.0, "size of each file, about [MB]")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        check_positive(self, "megabytes")
        if self.layouts is not None and (not self.layouts or len(set(self.layouts)) != len(self.layouts)):
            raise out_of_range("layouts", "must name each layout once", list(self.layouts))


@dataclass(unsafe_hash=True)
class BoundaryOptions:
    """Traffic among replayed vehicles"""

    vehicles: int = key(10, "simulated vehicles per scenario; REARL (Bi et al.)")
    scenarios: int = key(256, "scenarios simulated at a time")
    seconds: int = key(30, "simulated time of a rollout [s]")
    leaders: int = key(6, "replayed vehicles of scenes.boundary=leaders: one per lane of US-101")
    measured: int = key(23, "replayed vehicles that scenes.boundary=measured needs on US-101")
    repetitions: int = key(9, "measurements of every program, taken in turn")
    seed: int = key(0, "seed of the scenes and of the replayed vehicles")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        check_least(self, 1, "vehicles", "scenarios", "seconds", "leaders", "measured", "repetitions")
        check_least(self, 0, "seed")


@dataclass(unsafe_hash=True)
class CoreBenchmark:
    """Speed of the traffic core beside highway-env, SUMO, HighJax and a C program.

    The ratios are the result. With bench.against=FILE they are compared with those of an earlier benchmark, and the
    exit code is 1 if we have become slower.
    """

    study: str = study_key("bench_core")
    results: ResultsConfig = group_key(ResultsConfig)
    bench: CoreOptions = group_key(CoreOptions)


@dataclass(unsafe_hash=True)
class LoopBenchmark:
    """Cost of detection and decisions beside the traffic core, of decision steps and of every effect.

    No data are read: the references are synthetic.
    """

    study: str = study_key("bench_loop")
    results: ResultsConfig = group_key(ResultsConfig)
    loop: LoopOptions = group_key(LoopOptions)


@dataclass(unsafe_hash=True)
class BoundaryBenchmark:
    """CPU time of traffic among replayed vehicles, beside the same traffic on a free road.

    No data are read: the replayed vehicles are synthetic.
    """

    study: str = study_key("bench_boundary")
    results: ResultsConfig = group_key(ResultsConfig)
    boundary: BoundaryOptions = group_key(BoundaryOptions)


@dataclass(unsafe_hash=True)
class DiscoverBenchmark:
    """Elapsed time, CPU time and peak memory of discovery by number of drivers and recorded time.

    Every size is measured in a process of its own, from generated recordings, with empty caches. Sizes measured before
    an interruption are kept: the same command continues after them.
    """

    study: str = study_key("bench_discover")
    results: ResultsConfig = group_key(ResultsConfig)
    discover: DiscoverOptions = group_key(DiscoverOptions)


@dataclass(unsafe_hash=True)
class ReadersBenchmark:
    """Rows per second and peak memory of the readers of recordings.

    Every layout is written as one file of synthetic traffic, and read in a process of its own.
    """

    study: str = study_key("bench_readers")
    results: ResultsConfig = group_key(ResultsConfig)
    readers: ReadersOptions = group_key(ReadersOptions)

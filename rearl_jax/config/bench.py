"""Keys of the speed measurements."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


class Peer(Enum):
    """A program the traffic core is measured against."""

    c = "c"
    """The C program beside the benchmark, without collisions."""
    highway_env = "highway_env"
    libsumo = "libsumo"
    highjax = "highjax"
    gpu = "gpu"
    """The same core on a GPU, where JAX sees one."""


@dataclass(unsafe_hash=True)
class BenchConfig:
    """What is measured, how often and against whom."""

    vehicles: tuple[int, ...] = key((2, 10, 30, 100, 300, 1000), "vehicles per scenario, each measured")
    seconds: int = key(60, "simulated time of a rollout [s]; REARL (Bi et al.)")
    density: float = key(2.0, "vehicles_density of the initial scenes [-]; highway-env, REARL (Bi et al.)")
    seed: int = key(0, "seed of the initial scenes; every repetition draws new ones")
    repetitions: int = key(5, "measurements of every program, taken in turn")
    repetition_cpu_s: float = key(2.0, "CPU time a measurement aims at by its number of scenarios [s]")
    scenarios: tuple[int, ...] | None = key(
        None,
        "scenarios of a measurement of ours, one number per entry of vehicles; null: what fills the time",
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
        None, "summary.json of an earlier `rearl bench core`, or its folder; the task fails where we are slower now"
    )
    reference: Peer = key(Peer.c, "program whose ratio to ours is held against the earlier one")
    margin: float = key(0.15, "share of the earlier ratio that may be lost; own choice")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        _check_rising(self, "vehicles")
        for name in ("chunks", "threads"):
            if getattr(self, name):
                _check_rising(self, name)
        _check_least(self, 1, "seconds", "repetitions", "memory_vehicles", "varied_vehicles")
        _check_positive(self, "density", "repetition_cpu_s", "peer_cpu_s")
        _check_least(self, 0, "seed", "memory_rollouts")
        if not 0 < self.margin < 1:
            raise out_of_range("margin", "must be between 0 and 1", self.margin)
        if self.against is not None and self.reference not in self.peers:
            said = "must be one of peers: add it there, or choose another"
            raise out_of_range("reference", said, self.reference.name)
        if self.chunk is not None and self.chunk < 1:
            raise out_of_range("chunk", "must be at least 1 or null", self.chunk)
        if self.scenarios is not None and (len(self.scenarios) != len(self.vehicles) or min(self.scenarios) < 1):
            said = f"must hold one positive number for each of the {len(self.vehicles)} entries of vehicles"
            raise out_of_range("scenarios", said, list(self.scenarios))
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
class BenchLoopConfig:
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
    density: float = key(2.0, "vehicles_density of the initial scenes [-]; highway-env, REARL (Bi et al.)")
    seed: int = key(0, "seed of initial scenes and references; every repetition draws new scenes")
    repetitions: int = key(5, "measurements of every program, taken in turn")
    repetition_cpu_s: float = key(0.5, "CPU time a measurement of Base aims at; the others simulate as many [s]")
    rounds: int | None = key(None, "batches of a measurement; null: what fills the time")
    effects: tuple[str, ...] | None = key(
        None,
        "effects switched on one at a time, with the fewest vehicles and the largest batch; null: all, empty: none",
    )
    n_references: int = key(15, "synthetic references the traffic is held against; REARL (Bi et al.)")
    reference_seconds: int = key(60, "length of the references [s]; REARL (Bi et al.)")
    reference_vehicles: int = key(10, "vehicles of a reference; REARL (Bi et al.)")
    steps: int = key(10, "consecutive decision steps whose time is taken; REARL (Bi et al.)")
    steps_vehicles: int = key(10, "vehicles per scenario of these steps; REARL (Bi et al.)")
    steps_batches: tuple[int, ...] = key((1, 256), "scenarios at a time in these steps; empty leaves them out")
    steps_repetitions: int = key(20, "measurements of these steps")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        _check_rising(self, "vehicles")
        for name in ("batches", "steps_batches"):
            if getattr(self, name):
                _check_rising(self, name)
        if not (self.batches or self.steps_batches):
            said = "must name the scenarios at a time, or steps_batches must"
            raise out_of_range("batches", said, list(self.batches))
        _check_least(self, 1, "seconds", "repetitions", "n_references", "steps", "steps_repetitions")
        _check_least(self, 2, "reference_vehicles", "steps_vehicles")
        _check_positive(self, "density", "repetition_cpu_s")
        _check_least(self, 0, "seed")
        if self.vehicles[0] < 2:
            raise out_of_range("vehicles", "must be at least 2 each (a spacing needs two)", list(self.vehicles))
        if self.rounds is not None and self.rounds < 1:
            raise out_of_range("rounds", "must be at least 1 or null", self.rounds)
        if not self.policies or len(set(self.policies)) != len(self.policies):
            raise out_of_range("policies", "must name each policy once", [policy.name for policy in self.policies])
        if self.reference_seconds < max(self.seconds, self.steps):
            said = f"must be at least seconds and steps ({max(self.seconds, self.steps)})"
            raise out_of_range("reference_seconds", said, self.reference_seconds)


@dataclass(unsafe_hash=True)
class BenchStartupConfig:
    """How long one waits for a command"""

    repetitions: int = key(3, "measurements of every command; each begins with an empty cache")
    cold_s: float = key(15.0, "most that the first table of an evaluation should take with an empty cache [s]; goal")
    warm_s: float = key(6.0, "the same with the cache of the evaluation before [s]; goal")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        _check_least(self, 1, "repetitions")
        _check_positive(self, "cold_s", "warm_s")


@dataclass(unsafe_hash=True)
class BenchRequestsConfig:
    """How fast a language model is asked"""

    requests: int = key(4800, "different questions of a measurement of the server that takes a fixed time")
    latency: float = key(0.05, "time this server takes for a request [s]; own choice")
    slots: int = key(32, "requests it works on at a time; own choice")
    repetitions: int = key(3, "measurements of client and plain load generator, taken in turn")
    seed: int = key(0, "seed of the traffic that is asked about, and of its synthetic references")
    server: str | None = key(
        None, "a real server to be asked as well: its address, http only, or local; null leaves it out"
    )
    server_requests: int = key(24, "different questions of a measurement of the real server")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        _check_least(self, 1, "requests", "slots", "repetitions", "server_requests")
        _check_positive(self, "latency")
        _check_least(self, 0, "seed")


def _check_rising(record: object, *names: str) -> None:
    for name in names:
        values = list(getattr(record, name))
        if not values or values != sorted(set(values)) or values[0] < 1:
            raise out_of_range(name, "must be positive, rising numbers", values)


def _check_least(record: object, least: int, *names: str) -> None:
    for name in names:
        if getattr(record, name) < least:
            raise out_of_range(name, f"must be at least {least}", getattr(record, name))


def _check_positive(record: object, *names: str) -> None:
    for name in names:
        if not getattr(record, name) > 0:
            raise out_of_range(name, "must be > 0", getattr(record, name))

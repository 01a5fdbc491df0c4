"""Keys of the speed measurements."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key


class Peer(Enum):
    """A program the traffic core is measured against."""

    c = "c"
    highway_env = "highway_env"
    libsumo = "libsumo"


@dataclass(unsafe_hash=True)
class BenchConfig:
    """What is measured, how often and against whom."""

    vehicles: tuple[int, ...] = key((10, 30, 50, 100, 200), "vehicles per scenario, each measured")
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
    peers: tuple[Peer, ...] = key(
        (Peer.c, Peer.highway_env, Peer.libsumo), "programs measured beside ours; absent ones are named"
    )
    peer_cpu_s: float = key(3.0, "CPU time after which highway-env ends its scene with the second it is in [s]")
    memory_rollouts: int = key(100_000, "rollouts of the peak-memory measurement; 0 leaves it out")
    memory_vehicles: int = key(10, "vehicles per scenario of the peak-memory measurement")

    def check(self) -> None:
        """Ranges."""
        if not self.vehicles or list(self.vehicles) != sorted(set(self.vehicles)) or self.vehicles[0] < 1:
            raise ValueError(f"vehicles must be positive, rising numbers, got {list(self.vehicles)}")
        for name in ("seconds", "repetitions", "memory_vehicles"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        for name in ("density", "repetition_cpu_s", "peer_cpu_s"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in ("seed", "memory_rollouts"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name)}")
        if self.chunk is not None and self.chunk < 1:
            raise ValueError(f"chunk must be at least 1 or null, got {self.chunk}")
        if self.scenarios is not None and (len(self.scenarios) != len(self.vehicles) or min(self.scenarios) < 1):
            raise ValueError(
                f"scenarios must hold one positive number for each of the {len(self.vehicles)} entries of"
                f" vehicles, got {list(self.scenarios)}"
            )
        if len(set(self.peers)) != len(self.peers):
            raise ValueError(f"peers names a program twice: {[peer.name for peer in self.peers]}")

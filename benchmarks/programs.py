"""Programs that the traffic core is measured against, each started once per number of vehicles."""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from benchmarks.native import COMPILER, CompilerError, NativeProgram, compile_limit
from benchmarks.options import CoreOptions, Peer
from rearl_jax import runtime
from rearl_jax.timing.measurement import Simulator
from rearl_jax.timing.process import ProcessSession

OURS = "rearl_jax"
C_ALL = "c_all_threads"
"""The C program on all cores; as the peer `c` it has one thread."""
GPU = Peer.gpu.name
"""Our core on the accelerator that JAX sees."""

BY_ELAPSED_TIME = (C_ALL, GPU)
"""Programs compared with ours by elapsed time, ours on all cores; all others are compared by CPU time."""

TITLES = {OURS: "rearl_jax", "c": "C, one thread", C_ALL: "C, all cores", "highway_env": "highway-env"}
TITLES |= {"libsumo": "SUMO", "highjax": "HighJax", GPU: "rearl_jax, GPU"}
"""Names of all programs in tables and figures."""

GPU_VEHICLES = 2**20
"""Vehicles in the scenarios a GPU simulates at a time."""

REMEDIES = {
    Peer.c: f"install {COMPILER}, e.g. apt-get install {COMPILER}",
    Peer.highway_env: "pip install highway-env",
    Peer.libsumo: "pip install eclipse-sumo libsumo",
    Peer.highjax: "pip install flax && pip install --no-deps --ignore-requires-python highjax (it asks for Python 3.14,"
    " but runs on ours)",
    Peer.gpu: "on a machine with an NVIDIA GPU: pip install 'jax[cuda12]'",
}
"""Remedies for missing programs."""

_ADDRESSES = {
    Peer.highway_env: "benchmarks.highway:HighwayRoads",
    Peer.libsumo: "benchmarks.sumo:SumoRoads",
    Peer.highjax: "benchmarks.highjax:HighJaxRoads",
}
"""Classes of the peers that are Python libraries."""


@dataclass(frozen=True)
class Absent:
    """A peer that could not be measured, why, and how to get it."""

    program: str
    reason: str
    remedy: str


@runtime_checkable
class Session(Simulator, Protocol):
    """A program that runs in another process."""

    def close(self) -> None:
        """Ends the program."""
        ...


def start_ours(n_vehicles: int, bench: CoreOptions, *, threads: int | None = None, **others: Any) -> Session:
    """A new process with our core compiled for `n_vehicles` vehicles, on `threads` cores or all.

    `others` are further arguments of `ProcessSession` and of `benchmarks.rollouts.Rollouts`.
    """
    scene = {"n_vehicles": n_vehicles, "seconds": bench.seconds, "density": bench.density, "chunk": bench.chunk}
    return ProcessSession("benchmarks.rollouts:Rollouts", cpu_devices=threads, **(scene | others))


@contextmanager
def open_programs(n_vehicles: int, bench: CoreOptions) -> Iterator[tuple[dict[str, Session], list[Absent]]]:
    """All installed programs, ours first, ready for `n_vehicles` vehicles; and those that are absent."""
    sessions: dict[str, Session] = {}
    absent: list[Absent] = []
    with ExitStack() as stack:

        def add(name: str, session: Session) -> None:
            stack.callback(session.close)
            sessions[name] = session

        add(OURS, start_ours(n_vehicles, bench))
        for peer in bench.peers:
            if (reason := _reason_for_absence(peer)) is not None:
                absent.append(Absent(peer.name, reason, REMEDIES[peer]))
            elif peer is Peer.c:
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rearl_c_")))
                try:
                    program = compile_limit(n_vehicles, folder)
                except CompilerError as error:
                    absent.append(Absent(peer.name, str(error), REMEDIES[peer]))
                    continue
                add(peer.name, NativeProgram(program, bench.seconds, 1))
                if runtime.available_cores() > 1:
                    add(C_ALL, NativeProgram(program, bench.seconds, runtime.available_cores()))
            elif peer is Peer.gpu:
                add(GPU, start_ours(n_vehicles, bench, chunk=max(1, GPU_VEHICLES // n_vehicles), on_cpu=False))
            else:
                add(peer.name, _start_peer(peer, n_vehicles, bench))
        yield sessions, absent


def _start_peer(peer: Peer, n_vehicles: int, bench: CoreOptions) -> Session:
    scene: dict[str, Any] = {"n_vehicles": n_vehicles, "seconds": bench.seconds, "density": bench.density}
    limit: dict[str, Any] = {} if peer is Peer.libsumo else {"cpu_s": bench.peer_cpu_s}
    return ProcessSession(_ADDRESSES[peer], remedy="leave it out with bench.peers=[...]", **scene, **limit)


def _reason_for_absence(peer: Peer) -> str | None:
    """Reason why a peer cannot be measured here; None if it can, or if only its compiler can tell."""
    if peer is Peer.gpu:
        return None if sees_gpu() else "JAX sees no GPU on this machine"
    return None if peer is Peer.c or find_spec(peer.name) is not None else "not installed"


@cache
def sees_gpu() -> bool:
    """True if JAX would compute on a GPU; tested in a separate process, because JAX then takes most of its memory."""
    command = [sys.executable, "-c", "import jax; print(jax.default_backend())"]
    return subprocess.run(command, capture_output=True, text=True).stdout.split()[-1:] == ["gpu"]

"""The measured programs as this process sees them: each is started once per number of vehicles."""

import json
import os
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

from rearl_jax import runtime
from rearl_jax.bench.measurement import Measurement, Simulator
from rearl_jax.bench.native import COMPILER, CompilerError, NativeProgram, compile_limit
from rearl_jax.config.bench import BenchConfig, Peer

OURS = "rearl_jax"
C_ALL = "c_all_threads"
"""The C program on all cores; as the peer `c` it has one thread."""
GPU = Peer.gpu.name
"""Our core on the accelerator that JAX sees."""

BY_ELAPSED_TIME = (C_ALL, GPU)
"""Programs that are held against ours by elapsed time, ours on all cores; all others by CPU time."""

GPU_VEHICLES = 2**20
"""Vehicles in the scenarios a GPU simulates at a time; own choice."""

REMEDIES = {
    Peer.c: f"install {COMPILER}, e.g. apt-get install {COMPILER}",
    Peer.highway_env: "pip install highway-env",
    Peer.libsumo: "pip install eclipse-sumo libsumo",
    Peer.highjax: "pip install flax && pip install --no-deps --ignore-requires-python highjax (it asks for Python 3.14,"
    " but runs on ours)",
    Peer.gpu: "on a machine with an NVIDIA GPU: pip install 'jax[cuda12]'",
}
"""How to get what is not here."""

_SECONDS_TO_END = 10.0
"""Patience with a process that was told to end [s]."""


@dataclass(frozen=True)
class Absent:
    """A peer that could not be measured, why, and how to get it."""

    program: str
    reason: str
    remedy: str


@runtime_checkable
class Session(Simulator, Protocol):
    """A program that runs beside this process."""

    def close(self) -> None:
        """Ends whatever runs."""
        ...


class WorkerSession:
    """A program in a Python process of its own, which is what makes its CPU time and memory its own."""

    def __init__(self, program: str, *, on_cpu: bool = True, **arguments: Any) -> None:
        """Starts the process and waits until it is warm.

        Args:
            program: One of `rearl_jax.bench.worker`.
            on_cpu: Whether JAX sees the CPU alone.
            **arguments: What the program's class takes.

        Raises:
            RuntimeError: The program ended instead.
        """
        self._program = program
        self._complaints = tempfile.TemporaryFile("w+", encoding="utf-8")
        specification = json.dumps({"program": program, **arguments})
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rearl_jax.bench.worker", specification],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            encoding="utf-8",
            env=_worker_environment(on_cpu),
        )
        self._facts = self._answer()

    @property
    def facts(self) -> dict[str, float | int]:
        """What the worker said when it was ready."""
        return self._facts

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """One measurement.

        Raises:
            RuntimeError: The program ended instead.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"n_scenarios": n_scenarios, "seed": seed}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has ended; the missing answer below says why
        return Measurement(**self._answer())

    def close(self) -> None:
        """Ends the process, which ends by itself when its input does."""
        if self._complaints.closed:
            return
        try:
            self._process.communicate(timeout=_SECONDS_TO_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
        self._complaints.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if line:
            return json.loads(line)
        code = self._process.wait(_SECONDS_TO_END)
        self._complaints.seek(0)
        last = "\n".join(self._complaints.read().splitlines()[-20:])
        self.close()
        remedy = "; leave a peer out with bench.peers=[...]" if self._program in Peer.__members__ else ""
        raise RuntimeError(
            f"the measured program {self._program} ended with code {code}{remedy}. Its last words:\n{last}"
        )


def _worker_environment(on_cpu: bool) -> dict[str, str]:
    """Nothing compiled earlier: a program from the cache would hide the compile time."""
    package = str(Path(__file__).resolve().parents[2])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        **({"JAX_PLATFORMS": "cpu"} if on_cpu else {}),
        "JAX_ENABLE_COMPILATION_CACHE": "false",
        "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    }


def start_ours(n_vehicles: int, config: BenchConfig, **others: Any) -> Session:
    """A fresh process with our core compiled for so many vehicles.

    Args:
        n_vehicles: Vehicles per scenario.
        config: The rest of the scene, and the chunk.
        **others: What is otherwise: `chunk`, `threads`, `on_cpu`.
    """
    scene = {"n_vehicles": n_vehicles, "seconds": config.seconds, "density": config.density, "chunk": config.chunk}
    return WorkerSession(OURS, **(scene | others))


@contextmanager
def open_sessions(n_vehicles: int, config: BenchConfig) -> Iterator[tuple[dict[str, Session], list[Absent]]]:
    """All programs that are here, ours first, ready for so many vehicles; and those that are not."""
    scene = {"n_vehicles": n_vehicles, "seconds": config.seconds, "density": config.density}
    sessions: dict[str, Session] = {}
    absent: list[Absent] = []
    with ExitStack() as stack:

        def start(name: str, session: Session) -> None:
            stack.callback(session.close)
            sessions[name] = session

        start(OURS, start_ours(n_vehicles, config))
        for peer in config.peers:
            if (reason := _reason_for_absence(peer)) is not None:
                absent.append(Absent(peer.name, reason, REMEDIES[peer]))
            elif peer is Peer.c:
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rearl_c_")))
                try:
                    program = compile_limit(n_vehicles, folder)
                except CompilerError as error:
                    absent.append(Absent(peer.name, str(error), REMEDIES[peer]))
                    continue
                start(peer.name, NativeProgram(program, config.seconds, 1))
                if runtime.available_cores() > 1:
                    start(C_ALL, NativeProgram(program, config.seconds, runtime.available_cores()))
            elif peer is Peer.gpu:
                start(GPU, start_ours(n_vehicles, config, chunk=max(1, GPU_VEHICLES // n_vehicles), on_cpu=False))
            elif peer is Peer.libsumo:
                start(peer.name, WorkerSession(peer.name, **scene))
            else:
                start(peer.name, WorkerSession(peer.name, **scene, cpu_s=config.peer_cpu_s))
        yield sessions, absent


def _reason_for_absence(peer: Peer) -> str | None:
    """Why a peer cannot be measured here; None where it can, or where only its compiler knows."""
    if peer is Peer.gpu:
        return None if sees_gpu() else "JAX sees no GPU on this machine"
    if peer is Peer.c or find_spec(peer.name) is not None:
        return None
    return "not installed"


@cache
def sees_gpu() -> bool:
    """Whether JAX would compute on a GPU; asked in a process of its own, as JAX then takes most of its memory."""
    asked = [sys.executable, "-c", "import jax; print(jax.default_backend())"]
    return subprocess.run(asked, capture_output=True, text=True).stdout.split()[-1:] == ["gpu"]

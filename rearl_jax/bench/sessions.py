"""The measured programs as this process sees them: each is started once per number of vehicles."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
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

    def __init__(self, program: str, **arguments: Any) -> None:
        """Starts the process and waits until it is warm.

        Args:
            program: One of `rearl_jax.bench.worker`.
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
            env=_worker_environment(),
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


def _worker_environment() -> dict[str, str]:
    """CPU only, and nothing compiled earlier: a program from the cache would hide the compile time."""
    package = str(Path(__file__).resolve().parents[2])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        "JAX_PLATFORMS": "cpu",
        "JAX_ENABLE_COMPILATION_CACHE": "false",
        "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    }


def start_ours(n_vehicles: int, config: BenchConfig) -> Session:
    """A fresh process with our core compiled for so many vehicles."""
    return WorkerSession(
        OURS, n_vehicles=n_vehicles, seconds=config.seconds, density=config.density, chunk=config.chunk
    )


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
        if Peer.c in config.peers:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rearl_c_")))
            try:
                program = compile_limit(n_vehicles, folder)
            except CompilerError as error:
                absent.append(Absent("c", str(error), f"install {COMPILER}, e.g. apt-get install {COMPILER}"))
            else:
                start(Peer.c.name, NativeProgram(program, config.seconds, 1))
                if runtime.available_cores() > 1:
                    start(C_ALL, NativeProgram(program, config.seconds, runtime.available_cores()))
        if Peer.highway_env in config.peers:
            if find_spec("highway_env") is None:
                absent.append(Absent("highway_env", "not installed", "pip install highway-env"))
            else:
                start(Peer.highway_env.name, WorkerSession("highway_env", **scene, cpu_s=config.peer_cpu_s))
        if Peer.libsumo in config.peers:
            if find_spec("libsumo") is None:
                absent.append(Absent("libsumo", "not installed", "pip install eclipse-sumo libsumo"))
            else:
                start(Peer.libsumo.name, WorkerSession("libsumo", **scene))
        yield sessions, absent

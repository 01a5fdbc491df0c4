"""The C programs beside this file, compiled for this machine: the same traffic without collisions by hand, and what
the machine can do at best.
"""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rearl_jax.bench.measurement import TICKS_PER_SECOND, Measurement

TRAFFIC = Path(__file__).with_name("limit.c")
MACHINE = Path(__file__).with_name("machine_limits.c")

COMPILER = "gcc"
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-fopenmp")
LIBRARIES = ("-lmvec", "-lm")

GROUP = 16
"""Scenarios the program simulates side by side; it takes multiples of them only."""

LIMIT_S = 1.0
"""Elapsed time over which the best pass of each machine limit is looked for [s]; own choice."""


class CompilerError(RuntimeError):
    """The C program cannot be had on this machine; the message says why."""


@dataclass(frozen=True)
class MachineLimits:
    """What the machine can do at best with some threads.

    Attributes:
        threads: How many.
        bytes_per_s: Moved to and from memory, STREAM's triad [1/s].
        operations_per_s: Of float32, fused multiply-adds in registers counted as two [1/s].
    """

    threads: int
    bytes_per_s: float
    operations_per_s: float


def measure_limits(threads: int, folder: Path) -> MachineLimits:
    """The limits of this machine with so many threads, measured now.

    Raises:
        CompilerError: There is no compiler, or it does not know the flags or this processor.
        RuntimeError: The program failed.
    """
    program = _compile(MACHINE, folder / "machine_limits")
    return MachineLimits(**_run([str(program), str(LIMIT_S)], threads))


def compile_limit(n_vehicles: int, folder: Path) -> Path:
    """The program for scenarios of so many vehicles, compiled into a folder.

    Raises:
        CompilerError: There is no compiler, or it does not know the flags or this processor.
    """
    return _compile(TRAFFIC, folder / f"limit_{n_vehicles}", f"-DV={n_vehicles}")


def _compile(source: Path, program: Path, *definitions: str) -> Path:
    if shutil.which(COMPILER) is None:
        raise CompilerError(f"there is no C compiler {COMPILER}")
    command = [COMPILER, *FLAGS, *definitions, str(source), "-o", str(program), *LIBRARIES]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        reason = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
        raise CompilerError(f"{COMPILER} cannot compile it here: {reason}")
    return program


def _run(command: list[str], threads: int) -> dict[str, Any]:
    """What a program says, a JSON object."""
    # Threads that have no work left must sleep: waiting would count as CPU time.
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with code {done.returncode}: {done.stderr.strip()}")
    return json.loads(done.stdout)


class NativeProgram:
    """A compiled program; each measurement is one run of it."""

    def __init__(self, program: Path, seconds: int, threads: int) -> None:
        """Nothing runs yet.

        Args:
            program: From `compile_limit`.
            seconds: Simulated time [s].
            threads: Threads it may use.
        """
        self._program, self._seconds, self._threads = program, seconds, threads
        self.facts: Mapping[str, float | int] = {"unit": GROUP * threads}

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of `n_scenarios`, a multiple of 16; the program has only one seed of its own.

        Raises:
            RuntimeError: The program failed.
        """
        del seed
        said = _run([str(self._program), str(n_scenarios), str(self._seconds * TICKS_PER_SECOND)], self._threads)
        return Measurement(
            n_scenarios=n_scenarios,
            seconds=self._seconds,
            n_substeps=n_scenarios * said["vehicles"] * said["steps"],
            cpu_s=said["cpu_s"],
            wall_s=said["wall_s"],
            mean_speed=said["mean_speed"],
        )

    def close(self) -> None:
        """Nothing is left running."""

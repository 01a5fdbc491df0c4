"""The C program beside this file, compiled for this machine: the traffic of the core without collisions."""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from rearl_jax.timing.measurement import TICKS_PER_SECOND, Measurement

TRAFFIC = Path(__file__).with_name("limit.c")
"""Source of the C program."""

COMPILER = "gcc"
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-fopenmp")
LIBRARIES = ("-lmvec", "-lm")

GROUP = 16
"""Scenarios the program simulates at a time; the number of scenarios must be a multiple."""


class CompilerError(RuntimeError):
    """The C program cannot be compiled on this machine; the message contains the reason."""


def compile_limit(n_vehicles: int, folder: Path) -> Path:
    """The program for scenarios of `n_vehicles` vehicles, compiled into a folder.

    Raises:
        CompilerError: There is no compiler, or it does not know the flags or this processor.
    """
    if shutil.which(COMPILER) is None:
        raise CompilerError(f"there is no C compiler {COMPILER}")
    program = folder / f"limit_{n_vehicles}"
    command = [COMPILER, *FLAGS, f"-DV={n_vehicles}", str(TRAFFIC), "-o", str(program), *LIBRARIES]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        reason = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
        raise CompilerError(f"{COMPILER} cannot compile it here: {reason}")
    return program


class NativeProgram:
    """A compiled program; each measurement is one run of it."""

    def __init__(self, program: Path, seconds: int, threads: int) -> None:
        """Nothing runs yet; the program is that of `compile_limit`, `seconds` the simulated time [s]."""
        self._program, self._seconds, self._threads = program, seconds, threads
        self.facts: Mapping[str, float | int] = {"unit": GROUP * threads}

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of `n_scenarios`, a multiple of `GROUP`; `seed` is ignored, because the program has a fixed one.

        Raises:
            RuntimeError: The program failed.
        """
        del seed
        command = [str(self._program), str(n_scenarios), str(self._seconds * TICKS_PER_SECOND)]
        # Threads that have no work left must sleep: waiting would count as CPU time.
        environment = {**os.environ, "OMP_NUM_THREADS": str(self._threads), "OMP_WAIT_POLICY": "passive"}
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)} ended with code {done.returncode}: {done.stderr.strip()}")
        output = json.loads(done.stdout)
        return Measurement(
            n_scenarios=n_scenarios,
            seconds=self._seconds,
            n_substeps=n_scenarios * output["vehicles"] * output["steps"],
            cpu_s=output["cpu_s"],
            wall_s=output["wall_s"],
            mean_speed=output["mean_speed"],
        )

    def close(self) -> None:
        """Does nothing, because no program runs between measurements."""

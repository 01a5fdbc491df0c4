"""Measured programs in separate processes, so that CPU time and memory are those of the program alone.

The other process runs `python -m rearl_jax.timing.process SPECIFICATION`. The specification is a JSON object:
`program`, the address of a function or class as `module:name`, its `arguments`, and `cpu_devices`. The process writes
the facts of the program as one line of JSON. Then it reads one JSON object per line (`n_scenarios`, `seed`) and writes
a `Measurement` for each as one line of JSON. It ends when its standard input ends.
"""

import dataclasses
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

from rearl_jax.timing.measurement import Measurement, Simulator
from rearl_jax.timing.turns import Report

_SECONDS_TO_END = 10.0
"""Time for a process to end after the request to stop [s]."""


class ProcessSession:
    """A program in a separate Python process.

    Attributes:
        facts: Facts of the program, known as soon as it is ready.
    """

    def __init__(
        self, program: str, *, cpu_devices: int | None = 1, on_cpu: bool = True, remedy: str = "", **arguments: Any
    ) -> None:
        """Starts the process and waits until it is warm.

        Args:
            program: Address `module:name` of the function or class that creates the simulator.
            cpu_devices: CPU devices of JAX; None for one per core.
            on_cpu: Whether JAX sees the CPU alone.
            remedy: Advice to the user if the program fails.
            **arguments: Arguments of the function or class.

        Raises:
            RuntimeError: The program ended without an answer.
        """
        self._program, self._remedy = program, remedy
        self._error_output = tempfile.TemporaryFile("w+", encoding="utf-8")
        specification = {"program": program, "cpu_devices": cpu_devices, "arguments": arguments}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rearl_jax.timing.process", json.dumps(specification)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._error_output,
            encoding="utf-8",
            env=fresh_environment(on_cpu=on_cpu),
        )
        self.facts: dict[str, float | int] = self._answer()

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """One measurement of `n_scenarios` scenarios, drawn with `seed`.

        Raises:
            RuntimeError: The program ended without an answer.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"n_scenarios": n_scenarios, "seed": seed}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # the process has ended; `_answer` finds that its answer is missing
        return Measurement(**self._answer())

    def close(self) -> None:
        """Ends the process by closing its input."""
        if self._error_output.closed:
            return
        try:
            self._process.communicate(timeout=_SECONDS_TO_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
        self._error_output.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if line:
            return json.loads(line)
        code = self._process.wait(_SECONDS_TO_END)
        self._error_output.seek(0)
        last = "\n".join(self._error_output.read().splitlines()[-20:])
        self.close()
        remedy = f"; {self._remedy}" if self._remedy else ""
        raise RuntimeError(
            f"the measured program {self._program} ended with code {code}{remedy}. Its last output:\n{last}"
        )


def fresh_environment(*, on_cpu: bool = True) -> dict[str, str]:
    """Environment of a process with the import paths of this one, but without the cache of compiled programs, which
    would hide the compile time; `on_cpu` lets JAX see the CPU alone.
    """
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        **({"JAX_PLATFORMS": "cpu"} if on_cpu else {}),
        "JAX_ENABLE_COMPILATION_CACHE": "false",
        "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    }


@contextmanager
def open_sessions(
    program: str, names: Sequence[str], scene: Mapping[str, Any], label: str, report: Report
) -> Iterator[dict[str, Simulator]]:
    """Variants of a program by name, each compiled in a process of its own; `scene` holds their other arguments."""
    sessions: dict[str, Simulator] = {}
    with ExitStack() as stack:
        for name in names:
            report(f"{label}: {name}, compiling", 0)
            session = ProcessSession(program, name=name, **scene)
            stack.callback(session.close)
            sessions[name] = session
            report(f"{label}: {name}, compiled", 1)
        yield sessions


def main() -> None:
    """Serves measurements until the input ends."""
    # Libraries print greetings and warnings on standard output; these must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    specification = json.loads(sys.argv[1])
    from rearl_jax import runtime

    runtime.start(x64=False, cpu_devices=specification["cpu_devices"])
    module, _, name = specification["program"].partition(":")
    simulator: Simulator = getattr(import_module(module), name)(**specification["arguments"])
    print(json.dumps(dict(simulator.facts)), file=answers, flush=True)
    for line in sys.stdin:
        measurement = simulator.measure(**json.loads(line))
        print(json.dumps(dataclasses.asdict(measurement)), file=answers, flush=True)


if __name__ == "__main__":
    main()

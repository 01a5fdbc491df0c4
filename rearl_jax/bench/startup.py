"""`rearl bench startup`: how long one waits for a command, with an empty cache and with that of the command before.

Commands run as a user runs them, in processes of their own, one after the other; measured is the time to the first line
on standard output, which of an evaluation is its table, and to the end.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rearl_jax import runtime
from rearl_jax.bench.startup_results import Start, StartupResults
from rearl_jax.bench.startup_terminal import print_results
from rearl_jax.config.bench_tasks import BenchStartupTask
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study


@dataclass(frozen=True)
class Command:
    """A command whose start is measured.

    Attributes:
        name: In tables and figures.
        words: What Python is told.
        is_evaluation: Whether it is told where its results go.
    """

    name: str
    words: tuple[str, ...]
    is_evaluation: bool = False


_REARL = ("-m", "rearl_jax")
_EVALUATION = (*_REARL, "evaluate", "method=base")

COMMANDS = (
    Command("python", ("-c", "print()")),
    Command("import_package", ("-c", "import rearl_jax; print(rearl_jax.__version__)")),
    Command("import_jax", ("-c", "import jax; print(jax.__version__)")),
    Command("help", (*_REARL, "--help")),
    Command("evaluate_cold", _EVALUATION, is_evaluation=True),
    Command("evaluate_warm", _EVALUATION, is_evaluation=True),
)
"""In the order in which they run; of the evaluations, which read the shipped recordings, the first fills the cache."""


def run(config: BenchStartupTask) -> dict:
    """The summary of the measurements, after writing table, configuration and summary.

    Raises:
        RuntimeError: A command failed.
    """
    startup = config.startup
    study = Study(config.results.root, config.study, config, "bench startup")
    study.write_config()
    load = runtime.load_average()
    starts = []
    with progress_bar() as progress:
        bar = progress.add_task("starting", total=startup.repetitions * len(COMMANDS))
        for repetition in range(startup.repetitions):
            for command, start in measure_all(repetition):
                starts.append(start)
                progress.update(bar, description=command.name, advance=1)
    results = StartupResults(tuple(starts), startup.cold_s, startup.warm_s, load, runtime.describe_machine())
    study.write_table("bench_startup", results.table(), **results.metadata())
    summary = results.summary()
    study.write_summary(summary)
    print_results(results)
    return summary


def measure_all(repetition: int) -> Iterator[tuple[Command, Start]]:
    """Every command once, beginning with an empty cache of compiled programs and scenes."""
    with tempfile.TemporaryDirectory(prefix="rearl_startup_") as folder:
        for command in COMMANDS:
            yield command, measure(command, repetition, Path(folder))


def measure(command: Command, repetition: int, folder: Path) -> Start:
    """One start.

    Args:
        command: What is started.
        repetition: Number of the measurement.
        folder: Holds the cache, and takes the results.

    Raises:
        RuntimeError: The command failed.
    """
    words = [sys.executable, *command.words]
    if command.is_evaluation:
        words.append(f"results.root={folder / 'results'}")
    package = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    # Through a pipe Python would hold its output back to the end.
    environment = {**os.environ, "PYTHONPATH": paths, "PYTHONUNBUFFERED": "1", "XDG_CACHE_HOME": str(folder / "cache")}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    with tempfile.TemporaryFile("w+", encoding="utf-8") as complaints:
        before, begin = os.times(), time.perf_counter()
        with subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=complaints, encoding="utf-8", env=environment, cwd=folder
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            first_s = time.perf_counter() - begin
            process.stdout.read()
        wall_s, after = time.perf_counter() - begin, os.times()
        if process.returncode:
            complaints.seek(0)
            said = "\n".join(complaints.read().splitlines()[-20:])
            raise RuntimeError(f"{' '.join(words)} ended with code {process.returncode}. Its last words:\n{said}")
    cpu_s = sum(after[2:4]) - sum(before[2:4])
    return Start(command.name, repetition, first_s, wall_s, cpu_s)

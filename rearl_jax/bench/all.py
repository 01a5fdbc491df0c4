"""`rearl bench all`: every benchmark, one after the other, each in a folder of its own; all figures in one place."""

from dataclasses import replace

from rearl_jax.bench import core, loop, requests, startup
from rearl_jax.config import BenchCoreTask, BenchLoopTask, BenchRequestsTask
from rearl_jax.config.bench_tasks import BenchAllTask, BenchStartupTask
from rearl_jax.results import Study


def run(config: BenchAllTask) -> dict:
    """The figures of all benchmarks, each under the name of its benchmark; written as summary.json of the study.

    Raises:
        FileNotFoundError, ImportError, OSError, RuntimeError, ValueError: As the benchmarks do.
    """
    study = Study(config.results.root, config.study, config, "bench all")
    study.write_config()
    # A part that was left as it is would not have been measured beside the others.
    results = replace(config.results, resume=False)
    parts = {
        "core": lambda study: core.run(BenchCoreTask(study, results, config.bench)),
        "loop": lambda study: loop.run(BenchLoopTask(study, results, config.loop)),
        "requests": lambda study: requests.run(BenchRequestsTask(study, results, config.requests, config.llm)),
        "startup": lambda study: startup.run(BenchStartupTask(study, results, config.startup)),
    }
    figures: dict = {}
    for name, measure in parts.items():
        summary = measure(f"{config.study}/{name}")
        figures |= {f"{name}_{key}": value for key, value in summary.items()}
    figures["n_slower"] = figures["core_n_slower"]
    study.write_summary(figures)
    return figures

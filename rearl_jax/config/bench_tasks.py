"""Configuration records of the benchmarks that measure commands, or everything."""

from dataclasses import dataclass

from rearl_jax.config import ResultsConfig, _group, _study
from rearl_jax.config.bench import BenchConfig, BenchLoopConfig, BenchRequestsConfig, BenchStartupConfig
from rearl_jax.config.llm import LlmConfig


@dataclass(unsafe_hash=True)
class BenchStartupTask:
    """How long one waits for the first result."""

    study: str = _study("bench_startup")
    results: ResultsConfig = _group(ResultsConfig)
    startup: BenchStartupConfig = _group(BenchStartupConfig)


@dataclass(unsafe_hash=True)
class BenchAllTask:
    """Every benchmark."""

    study: str = _study("bench")
    results: ResultsConfig = _group(ResultsConfig)
    bench: BenchConfig = _group(BenchConfig)
    loop: BenchLoopConfig = _group(BenchLoopConfig)
    requests: BenchRequestsConfig = _group(BenchRequestsConfig)
    startup: BenchStartupConfig = _group(BenchStartupConfig)
    llm: LlmConfig = _group(LlmConfig)

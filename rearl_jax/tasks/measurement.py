"""Tasks that measure speed."""

from rearl_jax.tasks.task import Task

MEASUREMENT = (
    Task(
        words="bench core",
        run="rearl_jax.bench.core:run",
        config="rearl_jax.config:BenchCoreTask",
        summary="measure the traffic core beside highway-env, SUMO and a C program",
        description=(
            "Measures agent-substeps per CPU-second, compile time and peak memory of the traffic core, and "
            "in the same run highway-env, libsumo (extra `bench`) and a vectorised C program where a "
            "compiler is found. The ratios are the result."
        ),
        examples=("rearl bench core", "rearl bench core study=laptop"),
    ),
    Task(
        words="bench loop",
        run="rearl_jax.bench.loop:run",
        config="rearl_jax.config:BenchLoopTask",
        summary="measure what detection and decisions cost beside the traffic core",
        description=(
            "Measures, in turn within one run, the CPU time of Base rollouts, of the closed loop that is never "
            "triggered and of the closed loop that always is, by vehicles and scenarios at a time; then the time of "
            "ten consecutive decision steps. Reads no data: the references are synthetic. Prints tables, writes "
            "Parquet and a figure."
        ),
        examples=(
            "rearl bench loop",
            "rearl bench loop loop.vehicles=[10] loop.batches=[256,1200] study=laptop",
        ),
    ),
    Task(
        words="bench requests",
        run="rearl_jax.bench.requests:run",
        config="rearl_jax.config:BenchRequestsTask",
        summary="measure how fast a language model is asked",
        description=(
            "Asks the questions of a closed loop that is triggered every second: of a server that takes a fixed time "
            "for each, and of a real one where it is named; in turn through our client and through a plain load "
            "generator that neither parses nor keeps anything. Reads no data. Prints a table, writes Parquet."
        ),
        examples=(
            "rearl bench requests",
            "rearl bench requests requests.server=local llm.max_in_flight=2",
        ),
    ),
)

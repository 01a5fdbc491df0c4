"""Tasks that measure speed."""

from rearl_jax.tasks.task import Task

MEASUREMENT = (
    Task(
        words="bench all",
        run="rearl_jax.bench.all:run",
        config="rearl_jax.config.bench_tasks:BenchAllTask",
        failures="n_slower",
        summary="run every benchmark, one after the other",
        description=(
            "Runs `bench core`, `bench loop`, `bench requests` and `bench startup`, each into a folder of its own, and "
            "writes all their figures as one summary.json."
        ),
        examples=("rearl bench all", "rearl bench all study=laptop bench.vehicles=[10,1000]"),
    ),
    Task(
        words="bench core",
        run="rearl_jax.bench.core:run",
        config="rearl_jax.config:BenchCoreTask",
        failures="n_slower",
        summary="measure the traffic core beside highway-env, SUMO, HighJax and a C program",
        description=(
            "Measures agent-substeps per CPU-second, compile time and peak memory of the traffic core by vehicles, "
            "scenarios at a time and cores, and in the same run highway-env, libsumo (extra `bench`), HighJax, a "
            "vectorised C program where a compiler is found, the same core on a GPU where JAX sees one, and what the "
            "machine can do at best. The ratios are the result. With bench.against=FILE they are held against an "
            "earlier benchmark, and the task fails where we have become slower."
        ),
        examples=(
            "rearl bench core",
            "rearl bench core study=laptop",
            "rearl bench core study=after bench.vehicles=[10,1000] bench.peers=[c] bench.against=results/before",
        ),
    ),
    Task(
        words="bench loop",
        run="rearl_jax.bench.loop:run",
        config="rearl_jax.config:BenchLoopTask",
        summary="measure what detection and decisions cost beside the traffic core",
        description=(
            "Measures, in turn within one run, the CPU time of Base rollouts, of the closed loop that is never "
            "triggered and of the closed loop that always is, by vehicles and scenarios at a time; then the time of "
            "ten consecutive decision steps, and of Base with every effect switched on, one at a time. Reads no data: "
            "the references are synthetic. Prints tables, writes Parquet and a figure."
        ),
        examples=(
            "rearl bench loop",
            "rearl bench loop loop.vehicles=[10] loop.batches=[256,1200] study=laptop",
        ),
    ),
    Task(
        words="bench startup",
        run="rearl_jax.bench.startup:run",
        config="rearl_jax.config.bench_tasks:BenchStartupTask",
        summary="measure how long one waits for the first result",
        description=(
            "Runs commands as a user does, each in a process of its own: imports, the help, and an evaluation of the "
            "shipped recordings with an empty cache of compiled programs and then with a full one. Prints the time to "
            "the first line of output and to the end, writes Parquet."
        ),
        examples=("rearl bench startup", "rearl bench startup startup.repetitions=1"),
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

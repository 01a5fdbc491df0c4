"""CPU time of traffic among replayed vehicles, beside the same traffic on a free road.

Highway-env's drivers in single precision, in one process, the programs in turn. The replayed vehicles are synthetic:
lanes and positions are drawn, each keeps its speed, and now and then a vehicle enters; no data are read.
"""

import json
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from benchmarks.options import BoundaryBenchmark, BoundaryOptions
from benchmarks.terminal import print_table
from rearl_jax import runtime
from rearl_jax.core.boundary import Boundary, Entrants, Identity, Motion
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import TrafficState
from rearl_jax.machine import load_average
from rearl_jax.results import Study
from rearl_jax.timing.measurement import spread_of

FREE = "free"
"""Name of the program without replayed vehicles."""

GOALS = {"leaders": 1.15, "measured": 1.4}
"""Upper limits of the CPU time divided by that on a free road [-]."""

MEANINGS = {
    "cpu_ms_{boundary}": "CPU time of the rollouts, median of repetitions [ms]; boundary: free, leaders, measured",
    "ratio_{boundary}": "CPU time divided by that on the free road in the same repetition, median; also _min, _max",
    "places_{boundary}": "largest number of vehicles replayed at a time in each scenario",
    "load_average": "processes that wanted to run when the measurements began",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""

MODEL = TrafficModel(n_lanes=6)
"""A road with the lanes of US-101, the auxiliary lane included."""

ENTERING = 0.03
"""Share of the simulated vehicles that are replaced by an entering one in a second, as on US-101."""


def run(config: BoundaryBenchmark) -> dict:
    """The summary of the measurements, after writing table, configuration and summary."""
    options = config.boundary
    study = Study(config.results.root, config.study, config, "bench boundary")
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    load, machine = load_average(), runtime.describe_machine()
    n_replayed = {FREE: 0, "leaders": options.leaders, "measured": options.measured}
    cpu_s = measure({name: program(options, n) for name, n in n_replayed.items()}, options.repetitions)
    table = pd.DataFrame(
        [(name, repetition, 1e3 * time) for name, times in cpu_s.items() for repetition, time in enumerate(times)]
    )
    study.write_table("bench_boundary", table.set_axis(["boundary", "repetition", "cpu_ms"], axis=1))
    figures, rows = {}, []
    for name, times in cpu_s.items():
        ratio = spread_of([time / free for time, free in zip(times, cpu_s[FREE], strict=True)])
        figures |= {f"cpu_ms_{name}": 1e3 * float(np.median(times)), f"places_{name}": n_replayed[name]}
        figures |= ratio.figures(f"ratio_{name}")
        rows.append(
            {"boundary": name, "places": n_replayed[name], "CPU ms": figures[f"cpu_ms_{name}"], "/ free": ratio}
        )
        rows[-1]["goal"] = GOALS.get(name)
    summary = {**machine, "load_average": load, **figures}
    study.write_summary(summary)
    size = f"{options.scenarios} scenarios of {options.vehicles} vehicles for {options.seconds} s"
    print_table(f"Replayed vehicles, {size}", rows, [runtime.machine_line(machine, load)])
    return json.loads(json.dumps(summary))


def program(options: BoundaryOptions, n_places: int) -> Callable[[], object]:
    """Rollouts among `n_places` replayed vehicles per scenario; on a free road for 0."""
    keys = jax.random.split(jax.random.key(options.seed), options.scenarios)
    state, drivers = spawn(keys, MODEL, n_vehicles=options.vehicles)
    boundary = made_boundary(options, n_places) if n_places else None

    def run(state: TrafficState, drivers: Drivers, around: Boundary | None) -> Frames:
        return rollout(state, drivers, MODEL, n_seconds=options.seconds, boundary=around)[1]

    compiled = jax.jit(run)
    return lambda: jax.block_until_ready(compiled(state, drivers, boundary))


def made_boundary(options: BoundaryOptions, n_places: int) -> Boundary:
    """Synthetic traffic around the vehicles of `spawn`: `n_places` replayed vehicles per scenario."""
    rng, steps = np.random.default_rng(options.seed), MODEL.ticks_per_second
    n_seconds, n_vehicles, n_scenarios = options.seconds + 1, options.vehicles, options.scenarios
    time = (np.arange(n_seconds)[:, None] + np.arange(steps) / steps)[..., None, None]
    speed, start = rng.uniform(15, 25, (n_places, n_scenarios)), rng.uniform(-100, 400, (n_places, n_scenarios))
    lane = rng.integers(0, MODEL.n_lanes, (n_places, n_scenarios))
    x = start + speed * time

    def filled(values: np.ndarray, shape: tuple[int, ...], kind: type = np.float32) -> jax.Array:
        return jnp.asarray(np.broadcast_to(values, shape).astype(kind))

    replayed_shape = (n_seconds, n_places, n_scenarios)
    number = filled(np.arange(n_places)[:, None] + n_vehicles, replayed_shape, np.int32)
    zero, five = np.zeros(1), np.full(1, 5.0)
    entering_shape = (n_seconds, n_vehicles, n_scenarios)
    behind, fast = (
        filled(200.0 * np.arange(n_vehicles)[:, None], entering_shape),
        filled(np.full(1, 20.0), entering_shape),
    )
    entrants = Entrants(
        jnp.asarray(rng.random(entering_shape) < ENTERING),
        behind,
        filled(zero, entering_shape, np.int32),
        fast,
        fast + 5,
        filled(zero, entering_shape),
    )
    motion = Motion(filled(x, x.shape), filled(speed, x.shape), filled(zero, x.shape), filled(lane, x.shape, np.int32))
    identity = Identity(filled(five, replayed_shape), filled(zero, replayed_shape), number)
    return Boundary(motion, identity, entrants, jnp.arange(n_scenarios, dtype=jnp.int32))


def measure(programs: dict[str, Callable[[], object]], repetitions: int) -> dict[str, list[float]]:
    """CPU times [s] over all threads of each program, one per repetition; all are compiled before the first."""
    for run in programs.values():
        run()
    cpu_s: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(repetitions):
        for name, run in programs.items():
            begin = time.process_time()
            run()
            cpu_s[name].append(time.process_time() - begin)
    return cpu_s

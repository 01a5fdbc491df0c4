"""Cost of a rollout by the number simulated at a time, separately for simulation and scoring."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.runner import make_scorer
from rearl_jax.evaluation.scoring import Scorer
from rearl_jax.timing.measurement import Stopwatch

BATCHES = (1, 10, 100, 1_000, 10_000)
"""Measured batch sizes, up to the number of rollouts."""

MIN_REPETITIONS, MIN_TIME_S = 3, 1.0
"""Least number of repetitions of a batch, and least time of all its repetitions [s]."""


@dataclass(frozen=True)
class BatchCost:
    """Cost of a rollout in a batch: medians over the repetitions, with everything compiled.

    Attributes:
        n_rollouts: Rollouts of the batch.
        repetitions: Number of measurements.
        first_s: Elapsed time of the first call for the whole batch, which compiles or loads the programs [s].
        simulate_s: Elapsed time of the simulation per rollout [s].
        simulate_cpu_s: CPU time of the simulation per rollout [s].
        score_s: Elapsed time of the scoring per rollout [s].
        score_cpu_s: CPU time of the scoring per rollout [s].
    """

    n_rollouts: int
    repetitions: int
    first_s: float
    simulate_s: float
    simulate_cpu_s: float
    score_s: float
    score_cpu_s: float


def batch_costs(rollouts: Rollouts, scenes: SceneSet, progress: Callable[[int, int], None]) -> list[BatchCost]:
    """Cost of the first rollouts, one by one up to 10,000 at a time, or as many as there are.

    `progress` is called with the number of batch sizes done and their total.
    """
    sizes, costs = batch_sizes(len(rollouts)), []
    for size in sizes:
        progress(len(costs), len(sizes))
        costs.append(_cost(rollouts[:size], scenes))
    progress(len(sizes), len(sizes))
    return costs


def batch_sizes(n_rollouts: int) -> list[int]:
    """Measured batch sizes; for few rollouts, the last is all of them."""
    return sorted({min(size, n_rollouts) for size in BATCHES})


def _cost(rollouts: Rollouts, scenes: SceneSet) -> BatchCost:
    scorer = make_scorer(rollouts.config, scenes, len(rollouts))
    simulating, scoring = _timed(rollouts, scorer)
    first_s = simulating.wall_s + scoring.wall_s
    repetitions, elapsed_s = [], 0.0
    while len(repetitions) < MIN_REPETITIONS or elapsed_s < MIN_TIME_S:
        simulating, scoring = _timed(rollouts, scorer)
        repetitions.append((simulating.wall_s, simulating.cpu_s, scoring.wall_s, scoring.cpu_s))
        elapsed_s += simulating.wall_s + scoring.wall_s
    medians = np.median(repetitions, axis=0) / len(rollouts)
    return BatchCost(len(rollouts), len(repetitions), first_s, *medians.tolist())


def _timed(rollouts: Rollouts, scorer: Scorer) -> tuple[Stopwatch, Stopwatch]:
    """Time of simulating and of scoring all rollouts once, chunk by chunk as in the task."""
    simulating, scoring = Stopwatch(), Stopwatch()
    chunks = rollouts.chunks()
    done = 0
    while done < len(rollouts):
        with simulating:
            simulated = next(chunks)
        n = simulated.frames.x.shape[-1]
        with scoring:
            scorer.simulated(simulated, np.arange(n), rollouts[done : done + n].scene)
        done += n
    return simulating, scoring

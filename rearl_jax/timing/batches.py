"""Cost of a program whose compiled call simulates one batch of scenarios."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Key

from rearl_jax.core.rollout import Frames
from rearl_jax.decision.loop import Decisions
from rearl_jax.timing.measurement import Measurement, Stopwatch, measurement_of


@dataclass(frozen=True)
class Subject:
    """A measured program, with functions that prepare its input and read its output.

    Attributes:
        prepare: Makes the input of the program from one random key per scenario. Its time is not measured.
        run: The program. It must return all that is to be measured, because XLA omits what does not affect the output.
        frames: Takes the traffic from the input and the output of the program.
        decisions: Takes the decisions from the output of the program; returns None if there are none.
    """

    prepare: Callable[[Key[Array, " scenarios"]], Any]
    run: Callable[[Any], Any]
    frames: Callable[[Any, Any], Frames]
    decisions: Callable[[Any], Decisions | None]


class Batches:
    """Measurement of a program on one device, batch by batch.

    The time of a batch is from the call with the prepared input to the end of the computation.

    Attributes:
        facts: Scenarios per batch (`unit`), elapsed time of compiling [s], decisions per vehicle and simulated second.
    """

    def __init__(self, subject: Subject, *, batch: int, n_vehicles: int, seconds: int) -> None:
        """Compiles the program for batches of `batch` scenarios with `n_vehicles` vehicles over `seconds` seconds."""
        self._subject, self._batch, self._n_vehicles, self._seconds = subject, batch, n_vehicles, seconds
        self._prepare = jax.jit(subject.prepare)
        inputs = jax.block_until_ready(self._prepare(jax.random.split(jax.random.key(0), batch)))
        start = time.perf_counter()
        self._run = jax.jit(subject.run).lower(inputs).compile()
        compile_s = time.perf_counter() - start
        decisions = subject.decisions(self._run(inputs))
        n_asked = 0 if decisions is None else int(np.asarray(decisions.n_asked).sum())
        asked_share = n_asked / (batch * n_vehicles * seconds)
        self.facts: dict[str, float | int] = {"unit": batch, "compile_s": compile_s, "asked_share": asked_share}

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """Cost of simulating scenarios that are drawn from a seed, in whole batches.

        Raises:
            ValueError: The number of scenarios is not a multiple of the batch.
        """
        if n_scenarios % self._batch:
            raise ValueError(f"n_scenarios = {n_scenarios} is not a multiple of the batch of {self._batch}")
        watch = Stopwatch()
        chunks = self._timed_batches(n_scenarios, seed, watch)
        n_vehicles, seconds = self._n_vehicles, self._seconds
        return measurement_of(chunks, watch, n_scenarios=n_scenarios, n_vehicles=n_vehicles, seconds=seconds)

    def _timed_batches(self, n_scenarios: int, seed: int, watch: Stopwatch) -> Iterator[Frames]:
        """Frames of each batch as NumPy arrays. The stopwatch runs only while the program does."""
        for keys in jax.random.split(jax.random.key(seed), (n_scenarios // self._batch, self._batch)):
            inputs = jax.block_until_ready(self._prepare(keys))
            with watch:
                outputs = jax.block_until_ready(self._run(inputs))
            yield jax.tree.map(np.asarray, self._subject.frames(inputs, outputs))

"""One compiled call is one batch: the cost of a program that takes a batch of scenarios and returns at its end."""

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
    """A program to be measured, and what surrounds it.

    Attributes:
        prepare: From a random key per scenario to what the program takes; not measured.
        run: The program; all it returns is computed, so what it leaves out costs nothing.
        frames: The traffic, from what the program takes and what it returns.
        decisions: What was decided, from what the program returns; None where it does not say.
    """

    prepare: Callable[[Key[Array, " scenarios"]], Any]
    run: Callable[[Any], Any]
    frames: Callable[[Any, Any], Frames]
    decisions: Callable[[Any], Decisions | None]


class Batches:
    """A subject, batch by batch on one device; measured: from handing over a prepared batch to the end of the call."""

    def __init__(self, subject: Subject, *, batch: int, n_vehicles: int, seconds: int) -> None:
        """Compiles."""
        self._subject, self._batch, self._n_vehicles, self._seconds = subject, batch, n_vehicles, seconds
        self._prepare = jax.jit(subject.prepare)
        inputs = jax.block_until_ready(self._prepare(jax.random.split(jax.random.key(0), batch)))
        start = time.perf_counter()
        self._run = jax.jit(subject.run).lower(inputs).compile()
        self.compile_s = time.perf_counter() - start
        decisions = subject.decisions(self._run(inputs))
        n_asked = 0 if decisions is None else int(np.asarray(decisions.n_asked).sum())
        self.asked_share = n_asked / (batch * n_vehicles * seconds)

    @property
    def facts(self) -> dict[str, float | int]:
        """Size of a batch, elapsed time of compiling [s], share of the vehicle-seconds that follow a question."""
        return {"unit": self._batch, "compile_s": self.compile_s, "asked_share": self.asked_share}

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of whole batches drawn from the seed.

        Raises:
            ValueError: The scenarios are no multiple of the batch.
        """
        if n_scenarios % self._batch:
            raise ValueError(f"n_scenarios = {n_scenarios} is no multiple of the batch of {self._batch}")
        watch = Stopwatch()
        chunks = self._timed_batches(n_scenarios, seed, watch)
        n_vehicles, seconds = self._n_vehicles, self._seconds
        return measurement_of(chunks, watch, n_scenarios=n_scenarios, n_vehicles=n_vehicles, seconds=seconds)

    def _timed_batches(self, n_scenarios: int, seed: int, watch: Stopwatch) -> Iterator[Frames]:
        """Frames as NumPy arrays, batch by batch; the watch runs during the call alone."""
        for keys in jax.random.split(jax.random.key(seed), (n_scenarios // self._batch, self._batch)):
            inputs = jax.block_until_ready(self._prepare(keys))
            with watch:
                outputs = jax.block_until_ready(self._run(inputs))
            yield jax.tree.map(np.asarray, self._subject.frames(inputs, outputs))

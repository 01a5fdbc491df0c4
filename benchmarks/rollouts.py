"""The traffic core of rearl_jax as the subject of a measurement."""

from collections.abc import Iterator

import jax
from jaxtyping import Array, Key

from rearl_jax.core.batch import ScenarioMap, chunk_for
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.timing.measurement import TICKS_PER_SECOND, Measurement, Stopwatch, measurement_of


class Rollouts:
    """Rollouts in chunks on all cores; drawing the scenes, stepping and copying the frames are measured."""

    def __init__(self, n_vehicles: int, seconds: int, density: float, chunk: int | None) -> None:
        """Compiles and warms up; arguments as in `HighJaxRoads`; `chunk` None for `chunk_for`."""
        self._n_vehicles, self._seconds = n_vehicles, seconds
        self.chunk = chunk_for(n_vehicles) if chunk is None else chunk
        self.unit = self.chunk * len(jax.local_devices())
        model = TrafficModel(ticks_per_second=TICKS_PER_SECOND)

        def simulate(keys: Key[Array, " scenarios"]) -> Frames:
            state, drivers = spawn(keys, model, n_vehicles=n_vehicles, density=density)
            return rollout(state, drivers, model, n_seconds=seconds)[1]

        self._map = ScenarioMap(simulate, chunk=self.chunk)
        first, second = Stopwatch(), Stopwatch()
        for watch in (first, second):
            self._measure(self.unit, 0, watch)
        self.compile_s = max(first.wall_s - second.wall_s, 0.0)

    @property
    def facts(self) -> dict[str, float | int]:
        """Scenarios at a time on all cores (`unit`) and per core (`chunk`), cores, elapsed time of compiling [s]."""
        threads = len(jax.local_devices())
        return {"unit": self.unit, "chunk": self.chunk, "threads": threads, "compile_s": self.compile_s}

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of `n_scenarios` rollouts from newly drawn scenes."""
        return self._measure(n_scenarios, seed, Stopwatch())

    def _measure(self, n_scenarios: int, seed: int, watch: Stopwatch) -> Measurement:
        chunks = self._timed_chunks(n_scenarios, seed, watch)
        n_vehicles, seconds = self._n_vehicles, self._seconds
        return measurement_of(chunks, watch, n_scenarios=n_scenarios, n_vehicles=n_vehicles, seconds=seconds)

    def _timed_chunks(self, n_scenarios: int, seed: int, watch: Stopwatch) -> Iterator[Frames]:
        """Frames as NumPy arrays, chunk by chunk; the watch runs while one is computed and copied."""
        with watch:
            chunks = self._map.chunks(jax.random.split(jax.random.key(seed), n_scenarios))
        while True:
            with watch:
                frames = next(chunks, None)
            if frames is None:
                return
            yield frames

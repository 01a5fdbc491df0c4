"""Metrics of traffic against recorded scenes; one compiled program scores simulated and recorded traffic.

Arrays have the scenario axis last. Recorded arrays are copied for one batch at a time; per rollout, only its metrics
stay in memory.
"""

import functools
from collections.abc import Iterator

import jax
import numpy as np
from jaxtyping import Array, Int

from rearl_jax.config.metrics import MetricsConfig
from rearl_jax.core.batch import ScenarioMap, join_scenarios
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.simulators import Simulated
from rearl_jax.metrics.scene import (
    VEHICLE_WIDTH,
    SceneMetrics,
    Trajectories,
    scene_metrics,
    scene_reference,
)


def score(batch: tuple[dict[str, Array], dict[str, Array]], config: MetricsConfig) -> SceneMetrics:
    """Metrics of a batch of scenes, given as the fields of `Trajectories`, against recorded ones.

    The recorded ones are given by `scaled_speed`, `mean_spacing` and `spacing`.
    """
    scored, recorded = batch
    reference = scene_reference(recorded["scaled_speed"], recorded["mean_spacing"], recorded["spacing"], config.hist)
    return scene_metrics(Trajectories(**scored), reference, config)


@functools.cache
def _program(config: MetricsConfig, per_device: int) -> ScenarioMap:
    """Program that scores a batch; compiled once for all studies of a process."""
    return ScenarioMap(functools.partial(score, config=config), chunk=per_device)


class Scorer:
    """Scores traffic against the scenes of a set, in batches of equal size."""

    def __init__(self, scenes: SceneSet, config: MetricsConfig, *, per_device: int, dtype: np.dtype) -> None:
        """Compiles nothing yet; each device scores `per_device` scenarios at a time, in floating type `dtype`."""
        self._scenes, self._dtype = scenes, dtype
        self._map = _program(config, per_device)
        self._batch_size = per_device * len(jax.local_devices())

    def recorded(self, scored: Int[np.ndarray, " pairs"], scene: Int[np.ndarray, " pairs"]) -> SceneMetrics:
        """Metrics of the recorded scenes `scored` against the recorded scenes `scene`, both by index, pair by pair."""
        batches = self._batches(len(scene))
        return join_scenarios([self._score(self._recorded(scored[batch]), scene[batch]) for batch in batches])

    def simulated(
        self,
        simulated: Simulated,
        rollout: Int[np.ndarray, " pairs"],
        scene: Int[np.ndarray, " pairs"],
        track_id: Int[np.ndarray, "rollouts seconds vehicles"] | None = None,
    ) -> SceneMetrics:
        """Metrics of rollouts against recorded scenes, pair by pair.

        Args:
            simulated: Rollouts.
            rollout: Column of each pair's rollout.
            scene: Index of each pair's scene.
            track_id: Recorded vehicle in each slot; None if every slot holds the same vehicle throughout.
        """
        parts = []
        for batch in self._batches(len(scene)):
            trajectories = self._simulated(simulated, rollout[batch])
            if track_id is not None:
                trajectories["track_id"] = np.moveaxis(track_id[rollout[batch]], 0, -1).astype(np.int32)
            parts.append(self._score(trajectories, scene[batch]))
        return join_scenarios(parts)

    def _batches(self, n_pairs: int) -> Iterator[slice]:
        return (slice(start, start + self._batch_size) for start in range(0, n_pairs, self._batch_size))

    def _score(self, trajectories: dict[str, np.ndarray], scene: Int[np.ndarray, " pairs"]) -> SceneMetrics:
        """Metrics of at most one batch; the last pair fills up a smaller batch, so that one program serves all."""
        recorded = {
            name: self._gathered(getattr(self._scenes, name), scene)
            for name in ("scaled_speed", "mean_spacing", "spacing")
        }
        columns = np.minimum(np.arange(self._batch_size), len(scene) - 1)
        full = jax.tree.map(lambda leaf: leaf[..., columns], (trajectories, recorded))
        return jax.tree.map(lambda leaf: leaf[..., : len(scene)], self._map(full))

    def _gathered(self, values: np.ndarray, index: Int[np.ndarray, " pairs"]) -> np.ndarray:
        """Values of some scenes, the scene axis last."""
        kind = self._dtype if values.dtype.kind == "f" else np.int32
        return np.moveaxis(values[index].astype(kind), 0, -1)

    def _recorded(self, index: Int[np.ndarray, " pairs"]) -> dict[str, np.ndarray]:
        names = ("x", "y", "position", "speed", "scaled_speed", "lane", "length", "direction", "track_id")
        arrays = {name: self._gathered(getattr(self._scenes, name), index) for name in names}
        shape = arrays["x"].shape
        return arrays | {
            "crashed": np.zeros(shape, bool),
            "width": np.full(shape, VEHICLE_WIDTH, self._dtype),
        }

    def _simulated(self, simulated: Simulated, index: Int[np.ndarray, " pairs"]) -> dict[str, np.ndarray]:
        """Fields of simulated traffic: one carriageway along x, one vehicle per slot, all of the same width."""
        frames = simulated.frames
        picked = {
            name: np.asarray(getattr(frames, name))[..., index] for name in ("x", "y", "speed", "lane", "crashed")
        }
        if frames.n_crashed_replaced is not None:
            picked["n_crashed_replaced"] = np.asarray(frames.n_crashed_replaced)[..., index]
        length = np.asarray(simulated.length, self._dtype)[:, index]
        shape = picked["x"].shape
        slots = np.arange(shape[1], dtype=np.int32)[None, :, None]
        return picked | {
            "position": picked["x"],
            "scaled_speed": picked["speed"],  # only recorded speeds are rescaled, to the range of the simulator
            "length": np.broadcast_to(length, shape),
            "width": np.full(shape, VEHICLE_WIDTH, self._dtype),
            "direction": np.ones(shape, np.int32),
            "track_id": np.broadcast_to(slots, shape),
        }

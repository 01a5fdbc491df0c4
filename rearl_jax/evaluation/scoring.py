"""Metrics of simulated or recorded traffic against recorded scenes, by one compiled program for both.

Arrays have the scenario axis last. Real arrays are gathered for one batch at a time, so memory grows with the
number of rollouts only by their figures.
"""

import functools
from collections.abc import Iterator

import jax
import numpy as np
from jaxtyping import Array, Int

from rearl_jax.config.metrics import MetricsConfig
from rearl_jax.core.batch import ScenarioMap
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
    """Metrics of a batch of scenes, given as the fields of `Trajectories`, against real ones.

    The real ones are given by `scaled_speed`, `mean_spacing` and `spacing`.
    """
    scene, real = batch
    reference = scene_reference(real["scaled_speed"], real["mean_spacing"], real["spacing"], config.hist)
    return scene_metrics(Trajectories(**scene), reference, config)


def join(parts: list[SceneMetrics]) -> SceneMetrics:
    """Metrics of several parts in one record, along the scenario axis."""
    return jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)


@functools.cache
def _program(config: MetricsConfig, width: int) -> ScenarioMap:
    """Program that scores a batch; compiled once for all studies of a process."""
    return ScenarioMap(functools.partial(score, config=config), chunk=width)


class Scorer:
    """Scores traffic against the scenes of a set, in batches of one width."""

    def __init__(self, scenes: SceneSet, config: MetricsConfig, *, width: int, dtype: np.dtype) -> None:
        """Compiles nothing yet; `width` scenarios are scored at a time on each device, in floating type `dtype`."""
        self._scenes, self._dtype = scenes, dtype
        self._map = _program(config, width)
        self.batch = width * len(jax.local_devices())

    def recorded(self, candidate: np.ndarray, scene: np.ndarray) -> SceneMetrics:
        """Metrics of recorded scenes against others (or themselves), both given by index, pair by pair."""
        parts = []
        for at in self._batches(len(scene)):
            parts.append(self._score(self._recorded(candidate[at]), scene[at]))
        return join(parts)

    def simulated(
        self,
        simulated: Simulated,
        rollout: np.ndarray,
        scene: np.ndarray,
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
        for at in self._batches(len(scene)):
            trajectories = self._simulated(simulated, rollout[at])
            if track_id is not None:
                trajectories["track_id"] = np.moveaxis(track_id[rollout[at]], 0, -1).astype(np.int32)
            parts.append(self._score(trajectories, scene[at]))
        return join(parts)

    def _batches(self, n_pairs: int) -> Iterator[slice]:
        return (slice(start, start + self.batch) for start in range(0, n_pairs, self.batch))

    def _score(self, trajectories: dict[str, np.ndarray], scene: np.ndarray) -> SceneMetrics:
        """Metrics of at most one batch; a smaller batch is filled up, so that one program serves all."""
        real = {
            name: self._gathered(getattr(self._scenes, name), scene)
            for name in ("scaled_speed", "mean_spacing", "spacing")
        }
        columns = np.minimum(np.arange(self.batch), len(scene) - 1)
        full = jax.tree.map(lambda leaf: leaf[..., columns], (trajectories, real))
        return jax.tree.map(lambda leaf: leaf[..., : len(scene)], self._map(full))

    def _gathered(self, values: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Values of some scenes, the scene axis last."""
        kind = self._dtype if values.dtype.kind == "f" else np.int32
        return np.moveaxis(values[index].astype(kind), 0, -1)

    def _recorded(self, index: np.ndarray) -> dict[str, np.ndarray]:
        names = ("x", "y", "position", "speed", "scaled_speed", "lane", "length", "direction", "track_id")
        arrays = {name: self._gathered(getattr(self._scenes, name), index) for name in names}
        shape = arrays["x"].shape
        return arrays | {
            "crashed": np.zeros(shape, bool),
            "width": np.full(shape, VEHICLE_WIDTH, self._dtype),
        }

    def _simulated(self, simulated: Simulated, index: np.ndarray) -> dict[str, np.ndarray]:
        """Fields of simulated traffic: one carriageway along x, one vehicle per slot, all of the same width."""
        frames = simulated.frames
        picked = {
            name: np.asarray(getattr(frames, name))[..., index] for name in ("x", "y", "speed", "lane", "crashed")
        }
        if frames.left_crashed is not None:
            picked["left_crashed"] = np.asarray(frames.left_crashed)[..., index]
        length = np.asarray(simulated.length, self._dtype)[:, index]
        shape = picked["x"].shape
        slots = np.arange(shape[1], dtype=np.int32)[None, :, None]
        return picked | {
            "position": picked["x"],
            "scaled_speed": picked["speed"],
            "length": np.broadcast_to(length, shape),
            "width": np.full(shape, VEHICLE_WIDTH, self._dtype),
            "direction": np.ones(shape, np.int32),
            "track_id": np.broadcast_to(slots, shape),
        }

"""Distances between the trajectories of simulated and recorded vehicles, and between those of two recorded scenes."""

from dataclasses import replace
from functools import cache

import jax
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from rearl_jax._typing import SceneIndices
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.model import traffic_model
from rearl_jax.data.scenes.boundary import lanes_side_by_side
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import UNKNOWN_LANE
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.scores import Scores, known_values
from rearl_jax.evaluation.simulators import Simulated
from rearl_jax.metrics.energy import energy_score
from rearl_jax.metrics.measure import Measure
from rearl_jax.metrics.paths import Paths, displacement, frechet

_CHUNK = 64
"""Pairs of scenes that a device compares at a time. The tables of their Frechet distances must fit into its cache."""


def first_vehicle_values(
    scenes: SceneSet, index: np.ndarray, values: Shaped[np.ndarray, "scenes frames slots"]
) -> tuple[Shaped[np.ndarray, "chosen later vehicles"], Bool[np.ndarray, "chosen later vehicles"]]:
    """Values of the vehicles of the first snapshot in all later snapshots, and whether they are among the picked
    vehicles of these.

    Args:
        scenes: All scenes.
        index: Indices of the chosen scenes.
        values: Values of all scenes, by the place of a vehicle in its snapshot (slot).
    """
    track = scenes.track_id[index]
    is_same = track[:, 1:, :, None] == track[:, :1, None, :]  # [scenes, frames, slots, vehicles]
    return np.where(is_same, values[index][:, 1:, :, None], 0).sum(axis=2), is_same.any(axis=2)


def recorded_paths(scenes: SceneSet, index: Int[np.ndarray, " scenes"], config: EvaluateTask) -> Paths:
    """Paths of the vehicles of the first snapshot of some scenes.

    Positions are measured from the vehicle that is most upstream in this snapshot.
    """
    lane = lanes_side_by_side(scenes, scenes.lane.astype(np.int64), scenes.direction)
    along, known = first_vehicle_values(scenes, index, scenes.position)
    lane, _ = first_vehicle_values(scenes, index, lane)
    has_lane, _ = first_vehicle_values(scenes, index, scenes.lane != UNKNOWN_LANE)
    start = scenes.position[index, 0]
    along, known = along - start.min(axis=1)[:, None, None], known & (has_lane > 0)
    along, lane, known = (np.moveaxis(values, 0, -1) for values in (along, lane, known))
    return _ordered(along, lane, known, start.T, config)


def simulated_paths(simulated: Simulated, rollouts: Rollouts, scenes: SceneSet) -> Paths:
    """Paths of the vehicles that rollouts start with.

    If the start was drawn, the path begins with the first frame after the start, as in all metrics.
    """
    config, boundary = rollouts.config, rollouts.boundary
    x, lane = (np.asarray(values) for values in (simulated.frames.x, simulated.frames.lane))
    known = np.ones(x[1:].shape, bool)
    if config.init.source is not InitialSource.scene:
        return _ordered(x[1:] - x[0].min(axis=0), lane[1:], known, x[0], config)
    start = scenes.position[rollouts.scene, 0].T
    if boundary is None:
        # Frame k is at second k + 1, as is snapshot k + 1 of the scene.
        return _ordered(x[:-1], lane[:-1], known, start, config)
    known = np.moveaxis(boundary.is_new[rollouts.column].cumsum(axis=1)[:, 1:] == 0, 0, -1)
    origin = boundary.x[rollouts.column, 0].min(axis=1)  # not the minimum over all times: vehicles may enter upstream
    return _ordered(x[1:] - origin, lane[1:], known, start, config)


def _ordered(
    along: Float[np.ndarray, "seconds vehicles scenarios"],
    lane: Int[np.ndarray, "seconds vehicles scenarios"],
    known: Bool[np.ndarray, "seconds vehicles scenarios"],
    start: Float[np.ndarray, "vehicles scenarios"],
    config: EvaluateTask,
) -> Paths:
    """Paths of vehicles [m], ordered by their position at the start; the most upstream vehicle is first."""
    order = np.argsort(start, axis=0, kind="stable")[None]
    dtype, width = np.dtype(config.core.dtype.name), traffic_model(config.core).lane_width
    along, across, known = (np.take_along_axis(values, order, axis=1) for values in (along, lane * width, known))
    return Paths(along.astype(dtype), across.astype(dtype), known)


def with_paths(
    scores: Scores,
    paths: Paths,
    column: Int[np.ndarray, " pairs"],
    observed: Paths,
    held_out: SceneIndices,
) -> Scores:
    """The row with displacement and Frechet distance of every pair, and the energy score of every held-out scene.

    A pair is a rollout and the held-out scene with which it is compared. The energy score is over the vehicles and
    seconds that are known in the recorded scene. If the two have different numbers of vehicles, only the most upstream
    vehicles are compared, as many as the smaller number.

    Args:
        scores: The row.
        paths: Paths of the rollouts, or of the recorded scenes that are scored instead of rollouts.
        column: Index of the rollout of each pair in `paths`.
        observed: Paths of the held-out scenes.
        held_out: Indices of these scenes, in ascending order.
    """
    if len(column) == 0:
        return scores
    n_vehicles = min(paths.along.shape[1], observed.along.shape[1])
    paths, observed = (jax.tree.map(lambda leaf: leaf[:, :n_vehicles], record) for record in (paths, observed))
    scene_index = np.searchsorted(held_out, scores.scene)
    mean_distance, frechet_distance = _distance_program()((_select(paths, column), _select(observed, scene_index)))

    def of_run(run: int) -> Paths:
        """The paths of a run, scene by scene; all unknown in scenes for which this run is missing."""
        (pairs_of_run,) = np.nonzero(scores.run == run)
        scenes_of_run = scene_index[pairs_of_run]
        chosen, has_run = np.zeros(len(held_out), np.int64), np.zeros(len(held_out), bool)
        chosen[scenes_of_run], has_run[scenes_of_run] = column[pairs_of_run], True
        sample = _select(paths, chosen)
        return Paths(sample.along, sample.across, sample.known & observed.known & has_run)

    samples = [of_run(run) for run in np.unique(scores.run).tolist()]
    energy = energy_score(samples, observed, lambda *pair: known_values(_displacement_program()(pair)))
    pairs = {"displacement": mean_distance, "frechet": frechet_distance}
    return replace(
        scores,
        values=scores.values | {name: known_values(measure) for name, measure in pairs.items()},
        counts=scores.counts | {name: np.asarray(measure.count) for name, measure in pairs.items()},
        pooled=scores.pooled | {"energy_score": energy},
    )


def _select(paths: Paths, columns: np.ndarray) -> Paths:
    """The paths of the scenarios in some columns, the last axis."""
    return jax.tree.map(lambda leaf: leaf[..., columns], paths)


@cache
def _distance_program() -> ScenarioMap[tuple[Paths, Paths], tuple[Measure, Measure]]:
    """Program for displacement and Frechet distance; compiled once for all studies of a process."""
    return ScenarioMap(lambda pair: (displacement(*pair), frechet(*pair)), chunk=_CHUNK)


@cache
def _displacement_program() -> ScenarioMap[tuple[Paths, Paths], Measure]:
    """Program for the displacement alone; compiled once for all studies of a process."""
    return ScenarioMap(lambda pair: displacement(*pair), chunk=_CHUNK)

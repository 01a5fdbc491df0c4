"""Distance of simulated vehicles from their recorded positions, and their overlap with replayed vehicles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from rearl_jax.config.core import InitialSource
from rearl_jax.data.scenes.boundary import SceneBoundary
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.estimates import finite_mean, grouped_mean
from rearl_jax.evaluation.extras import Extra, Figures
from rearl_jax.evaluation.paths import first_vehicle_values
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.scores import title_of
from rearl_jax.evaluation.simulators import Simulated


@dataclass(frozen=True)
class Positions:
    """Simulated positions of some rollouts, compared with recorded ones.

    Attributes:
        scene: Index of the scene of each rollout.
        run: Run of each rollout.
        error: Mean distance along the road between simulated and recorded positions at the same time [m]; NaN
            without recorded positions.
        first_error: The same for the vehicles of the first snapshot alone, until they are no longer picked, which
            every value of `scenes.boundary` simulates [m].
        overlap: Share of the vehicle-seconds in which a simulated vehicle overlaps a replayed one [-].
    """

    scene: Int[np.ndarray, " rollouts"]
    run: Int[np.ndarray, " rollouts"]
    error: Float[np.ndarray, " rollouts"]
    first_error: Float[np.ndarray, " rollouts"]
    overlap: Float[np.ndarray, " rollouts"]


def positions_of(simulated: Simulated, rollouts: Rollouts, scenes: SceneSet) -> Positions | None:
    """Positions of rollouts that start from recorded scenes; None for others.

    Seconds in which a vehicle starts or enters are left out, because it is then at its recorded position.
    """
    if rollouts.config.init.source is not InitialSource.scene:
        return None
    x, index, boundary = np.moveaxis(np.asarray(simulated.frames.x), -1, 0), rollouts.scene, rollouts.boundary
    overlap = np.zeros(len(index))
    if boundary is None:
        recorded, is_known = first_vehicle_values(scenes, index, scenes.position)
        recorded = recorded - scenes.position[index, :1].min(axis=2, keepdims=True)
        x = x[:, : recorded.shape[1]]  # frame k is at second k + 1, as is snapshot k + 1 of the scene
        is_first = np.logical_and.accumulate(is_known, axis=1)
    else:
        is_new = boundary.is_new[rollouts.column]
        recorded, is_known, is_first = boundary.x[rollouts.column], ~is_new, ~is_new.cumsum(axis=1).astype(bool)
        is_known[:, 0] = False
        overlap = overlaps(simulated, boundary, rollouts.column).mean(axis=(1, 2))
    distance = np.abs(x - recorded)
    errors = (_mean(distance, is_known), _mean(distance, is_known & is_first))
    return Positions(index, rollouts.run, *errors, overlap)


def _mean(
    distance: Float[np.ndarray, "rollouts seconds vehicles"], is_known: Bool[np.ndarray, "rollouts seconds vehicles"]
) -> Float[np.ndarray, " rollouts"]:
    """Mean of the known distances of each rollout [m]; NaN without any."""
    n_known = is_known.sum(axis=(1, 2))
    total = np.where(is_known, distance, 0.0).sum(axis=(1, 2))
    return np.where(n_known > 0, total / np.maximum(n_known, 1), np.nan)


def overlaps(
    simulated: Simulated, boundary: SceneBoundary, column: Int[np.ndarray, " rollouts"]
) -> Bool[np.ndarray, "rollouts seconds vehicles"]:
    """True where a simulated vehicle overlaps a replayed one on its lane.

    `column` is the index of each rollout's scene in `boundary`.
    """
    x, lane = (
        np.moveaxis(np.asarray(values), -1, 0)[..., None] for values in (simulated.frames.x, simulated.frames.lane)
    )
    half = np.asarray(simulated.length).T[:, None, :, None] / 2 + boundary.replayed_length[column][:, :, None] / 2
    # Replayed vehicles are known at every time step; index 0 is the beginning of a second.
    other_x, other_lane = boundary.replayed_x[column][:, :, 0], boundary.replayed_lane[column][:, :, 0]
    return ((np.abs(x - other_x[:, :, None]) < half) & (lane == other_lane[:, :, None])).any(axis=-1)


def join_positions(parts: Sequence[Positions]) -> Positions:
    """Positions of several records in one record."""
    return Positions(*(np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])))


def position_figures(positions: Positions) -> Figures:
    """Means over scenes of means over runs: `position_error` [m] and `overlap_share` [-]."""
    scenes, group = np.unique(positions.scene, return_inverse=True)
    figures = {"position_error": positions.error, "overlap_share": positions.overlap}
    return {name: finite_mean(grouped_mean(values, group, len(scenes))) for name, values in figures.items()}


def position_extra(scene_id: np.ndarray, positions_by_row: Mapping[str, Positions]) -> Extra:
    """Table `positions` with one row per rollout, and a note on every row of the evaluation."""
    tables, notes = [], []
    for name, positions in positions_by_row.items():
        columns = {
            "method": pd.Categorical([name], list(positions_by_row)).repeat(len(positions.scene)),
            "scene_id": scene_id[positions.scene].astype(np.int32),
            "run": positions.run.astype(np.int32),
            "position_error": positions.error,
            "overlap_share": positions.overlap,
        }
        tables.append(pd.DataFrame(columns))
        figures = position_figures(positions)
        notes.append(f"{title_of(name)} {figures['position_error']:.1f} m")
    distance = f"distance of vehicles from their recorded positions, as long as they were recorded: {', '.join(notes)}"
    return Extra({"positions": pd.concat(tables, ignore_index=True)}, (distance,))

"""Trials of mixtures of driver classes: simulated in one batch and scored against the threshold scenes."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from rearl_jax._typing import SceneIndices
from rearl_jax.baselines.critical.adaptation import Assessment
from rearl_jax.baselines.critical.asking import NEAR_MISS_TIME
from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import make_scorer, scored_chunks
from rearl_jax.evaluation.scores import scores_of


def assess(
    config: EvaluateTask,
    scenes: SceneSet,
    subset: SceneIndices,
    candidates: Sequence[Mixture],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Assessment]:
    """Errors, crashes and near misses of `critical.rollouts` rollouts of each mixture.

    Every call simulates from the same initial states.

    Rollouts with drawn starts are scored against every scene. Rollouts that start as recorded are scored against their
    own scene, equally many for every scene.

    Raises:
        ValueError: There is no Hellinger distance or no spacing error.
    """
    is_drawn = config.init.source is InitialSource.seed
    n_runs = config.critical.rollouts if is_drawn else math.ceil(config.critical.rollouts / len(subset))
    scope, n_scored = (SeedScope.run, len(subset)) if is_drawn else (SeedScope.run_x_scene, 1)
    config = replace(
        config,
        eval=replace(config.eval, n_runs=n_runs, seed_scope=scope),
        safety=replace(config.safety, ttc=NEAR_MISS_TIME),
    )
    rollouts = Rollouts([Row(config, mixture=mixture) for mixture in candidates], scenes, subset, apart=is_drawn)
    scorer = make_scorer(config, scenes, n_runs * len(subset))
    parts = []
    for _, chunk in scored_chunks(rollouts, scorer, subset, progress):
        scores = scores_of(config.method.name, chunk.scene, chunk.run, chunk.metrics)
        near_misses = np.nan_to_num(scores.values["ttc_share"]) * scores.counts["ttc_share"]
        of_pairs = (*(scores.values[name] for name in ("h", config.mape.column, "collisions")), near_misses)
        parts.append(np.reshape(of_pairs, (len(of_pairs), -1, n_scored)))
    figures = np.concatenate(parts, axis=1)
    by_mixture = (figures[:, rollouts.row == number] for number in range(len(candidates)))
    return [_assessment(*of_mixture, n_vehicles=config.core.n_vehicles) for of_mixture in by_mixture]


def _assessment(
    h: Float[np.ndarray, "rollouts scenes"],
    mape: Float[np.ndarray, "rollouts scenes"],
    crashed_share: Float[np.ndarray, "rollouts scenes"],
    near_misses: Float[np.ndarray, "rollouts scenes"],
    *,
    n_vehicles: int,
) -> Assessment:
    """Assessment of one mixture. Crashes and near misses [vehicle-seconds] are the same against every scene."""
    h, mape = h[np.isfinite(h)], mape[np.isfinite(mape)]
    if not h.size or not mape.size:
        raise ValueError("a mixture of driver classes gave no h or no mape, so it cannot be compared with others")
    return Assessment(
        h=float(h.mean()),
        mape=float(mape.mean()),
        crashed=round(float(crashed_share[:, 0].sum()) * n_vehicles),
        near_misses=round(float(near_misses[:, 0].sum())),
        n_vehicles=n_vehicles * len(crashed_share),
    )

"""Scenes of other traffic, such as another program's simulation, scored as simulated scenes are.

Each scene is compared with recorded scenes. For reference, other recorded scenes take the place of this traffic, as in
the row real against real.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.config import EvaluateTask
from rearl_jax.data.scenes.scene_set import ARRAYS, SceneSet
from rearl_jax.evaluation.estimates import finite_mean, grouped_mean
from rearl_jax.evaluation.runner import make_scorer
from rearl_jax.evaluation.scores import (
    MEASURED,
    REAL_VS_REAL,
    Scores,
    of_recordings,
    partners,
    scores_of,
)
from rearl_jax.problems import InvalidInputError, Problem

OTHER = "other_traffic"
"""Name of the row of the other traffic."""


def score_traffic(other: SceneSet, recorded: SceneSet, config: EvaluateTask | None = None) -> pd.DataFrame:
    """Metrics of other traffic and of recorded scenes, each against recorded scenes: means over the recorded scenes.

    Columns: `metric`, `other_traffic`, `real_vs_real`, in the units of the metric table; for a
    metric that describes a single scene, these are the means over the other traffic and over the recorded scenes.
    Speeds of both are rescaled as those of the recorded scenes.

    Args:
        other: Scenes of the other traffic, as returned by `cut_scenes`.
        recorded: Recorded scenes, with as many seconds and vehicles.
        config: Metrics, and `eval.n_runs` scenes of either kind that each recorded scene is compared with.

    Raises:
        InvalidInputError: Scenes differ in seconds or vehicles.
    """
    config = EvaluateTask() if config is None else config
    if (other.seconds, other.n_slots) != (recorded.seconds, recorded.n_slots):
        shapes = [f"{scenes.seconds} s and {scenes.n_slots} vehicles" for scenes in (other, recorded)]
        message = f"have {shapes[0]}, and the recorded ones {shapes[1]}"
        remedy = "cut both with the same scenes.seconds and scenes.slots"
        raise InvalidInputError(Problem("scenes-differ", message, remedy, key="scenes"))
    both = _joined(recorded, other)
    index = np.arange(len(recorded))
    rng = np.random.default_rng(config.eval.seed)
    n_drawn = min(config.eval.n_runs, len(other))
    drawn = np.stack([len(recorded) + rng.permutation(len(other))[:n_drawn] for _ in index])
    pairs = {
        OTHER: (drawn.ravel(), np.repeat(index, n_drawn), np.tile(np.arange(n_drawn), len(index))),
        REAL_VS_REAL: partners(recorded, index, config.eval),
    }
    scorer = make_scorer(config, both, max(len(scene) for _, scene, _ in pairs.values()))
    rows = {}
    for name, (partner, scene, run) in pairs.items():
        if not len(scene):
            continue  # every other recorded scene shares a second of traffic
        metrics = scorer.recorded(partner, scene)  # the other traffic has the form of recorded scenes too
        rows[name] = of_recordings(scores_of(name, scene, run, metrics, partner=partner), both)
    return pd.DataFrame([{"metric": name, **{row: _mean(rows.get(row), name) for row in pairs}} for name in MEASURED])


def _joined(recorded: SceneSet, other: SceneSet) -> SceneSet:
    """The recorded scenes followed by the others, with the speed rescaling of the recorded ones."""
    arrays = {name: np.concatenate([getattr(recorded, name), getattr(other, name)]) for name in ARRAYS}
    return replace(recorded, **arrays, infos=(*recorded.infos, *other.infos))


def _mean(scores: Scores | None, metric: str) -> float:
    """Mean over recorded scenes of the means over their pairs; NaN if no pair has a value, or without pairs."""
    if scores is None or metric not in scores.values:
        return float("nan")
    return finite_mean(grouped_mean(scores.values[metric], scores.scene, int(scores.scene.max(initial=0)) + 1))

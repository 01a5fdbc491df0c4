"""Scores of other traffic, such as the simulation of another program, in the metrics of simulated scenes.

Each recorded scene is compared with scenes of the other traffic. For reference, it is also compared with other recorded
scenes, as in the row real against real.
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
"""Name of the row and column of the other traffic."""


def score_traffic(other: SceneSet, recorded: SceneSet, config: EvaluateTask | None = None) -> pd.DataFrame:
    """Metrics of the other traffic and, for reference, of recorded scenes, both compared with the recorded scenes.

    Columns: `metric`, `other_traffic`, `real_vs_real`, means over the recorded scenes in the units of the metric table.
    For a metric that describes a single scene, these are the means over the other traffic and over the recorded scenes.
    Speeds of the other traffic are rescaled in the same way as those of the recorded scenes.

    Args:
        other: Scenes of the other traffic, as returned by `cut_scenes`.
        recorded: Recorded scenes, with the same number of seconds and vehicles as `other`.
        config: The metrics, and `eval.n_runs`: each recorded scene is compared with this number of scenes of the other
            traffic, and with this number of recorded scenes.

    Raises:
        InvalidInputError: The number of seconds or of vehicles differs.
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
            continue  # no two recorded scenes can be compared, because all overlap in time
        metrics = scorer.recorded(partner, scene)  # scenes of the other traffic are stored like recorded ones
        rows[name] = of_recordings(scores_of(name, scene, run, metrics, partner=partner), both)
    return pd.DataFrame([{"metric": name, **{row: _mean(rows.get(row), name) for row in pairs}} for name in MEASURED])


def _joined(recorded: SceneSet, other: SceneSet) -> SceneSet:
    """The recorded scenes and after them the others; speeds of all are rescaled as those of the recorded scenes."""
    arrays = {name: np.concatenate([getattr(recorded, name), getattr(other, name)]) for name in ARRAYS}
    return replace(recorded, **arrays, infos=(*recorded.infos, *other.infos))


def _mean(scores: Scores | None, metric: str) -> float:
    """Mean over recorded scenes of the mean over the pairs of each scene; NaN if no pair has a value."""
    if scores is None or metric not in scores.values:
        return float("nan")
    return finite_mean(grouped_mean(scores.values[metric], scores.scene, int(scores.scene.max(initial=0)) + 1))

"""Detection thresholds as percentiles of the errors of the method base on the threshold scenes."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from rich.progress import Progress

from rearl_jax._typing import SceneIndices
from rearl_jax.config import EvaluateTask
from rearl_jax.config.detection import Cues
from rearl_jax.config.evaluation import Method
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.inputs import Inputs
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import scored_rollouts
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED
from rearl_jax.evaluation.tables import frame_series
from rearl_jax.evaluation.traffic import calibrated
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import shown

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class BaseValues:
    """Errors that the detection would compute for the method base, pooled over scenes, runs and seconds.

    Attributes:
        h: Hellinger distances of all full windows [-].
        mape: Spacing errors of all seconds under `mape.definition` [-].
        scene: Indices of the scenes.
    """

    h: Float[np.ndarray, " windows"]
    mape: Float[np.ndarray, " seconds"]
    scene: Int[np.ndarray, " scenes"]

    def threshold_h(self, percentile: float) -> float:
        """Threshold of the Hellinger distance at a percentile [%]."""
        return float(np.percentile(self.h, percentile))

    def threshold_m(self, percentile: float) -> float:
        """Threshold of the spacing error at a percentile [%]."""
        return float(np.percentile(self.mape, percentile))


def base_values(
    config: EvaluateTask,
    scenes: SceneSet,
    subset: SceneIndices,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> BaseValues:
    """Values of base on the threshold scenes, `eval.n_runs` rollouts of each; for variant=all they are simulated
    without effects.

    Raises:
        ValueError: There is no value to take a percentile of.

    Source: REARL (Bi et al.): 150 scenes, 5 runs, 56 windows and 60 seconds, so 42,000 and 45,000 values.
    """
    config = calibrated(replace(config, method=Method.base))
    row = scored_rollouts(Rollouts([Row(config)], scenes, subset), scenes, subset, progress)
    series = frame_series(row, config.hist.window)
    h, mape = (series[name][np.isfinite(series[name])] for name in ("h", config.mape.column))
    if not len(h) or not len(mape):
        message = "base gave no Hellinger distance or no spacing error to take percentiles of"
        raise InvalidInputError(Problem("no-figure", message, "set hist.window lower, or read more recordings"))
    return BaseValues(h, mape, subset)


def thresholds_of(config: EvaluateTask, inputs: Inputs, bar: Progress) -> tuple[float, float]:
    """Thresholds of the Hellinger distance and of the spacing error: given ones, else percentiles of base.

    Infinite if the cue is not used or the method detects nothing; base is simulated only for a percentile.
    """
    if not config.method.needs_references:
        return NEVER_EXCEEDED
    detection = config.detection
    h = detection.threshold_h if detection.cues in (Cues.both, Cues.speed) else math.inf
    m = detection.threshold_m if detection.cues in (Cues.both, Cues.spacing) else math.inf
    progress = shown(bar, "thresholds")
    if h is None or m is None:
        base = base_values(config, inputs.scenes, inputs.splits.threshold, progress)
        h = base.threshold_h(detection.h_pct) if h is None else h
        m = base.threshold_m(detection.m_pct) if m is None else m
    log.info("thresholds: Hellinger distance %.4f, spacing error %.4f", h, m)
    return h, m

"""Errors of the method base, whose percentiles are the thresholds of detection, kept in the study folder."""

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

from rearl_jax._typing import SceneIndices
from rearl_jax.config import EvaluateTask
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.percentiles import BaseValues, base_values
from rearl_jax.results import Study

BASE_VALUES = "base_values"
"""Name of the table: one row per value, with `cue` (h or mape) and `value`."""

_CUES = ["h", "mape"]


def kept_base_values(
    config: EvaluateTask,
    study: Study,
    scenes: SceneSet,
    subset: SceneIndices,
    metadata: Mapping[str, str],
    progress: Callable[[int, int], None],
) -> BaseValues:
    """Values of base in the threshold scenes (indices `subset`): from `base_values.parquet`, so that resumed studies
    have the same thresholds; else computed by `evaluation.percentiles.base_values` and written with the metadata.
    """
    if not study.owns(BASE_VALUES):
        base = base_values(config, scenes, subset, progress)
        cues = pd.Categorical.from_codes(np.repeat([0, 1], [len(base.h), len(base.mape)]), _CUES)
        values = np.concatenate([base.h, base.mape]).astype(np.float32)
        study.write_table(BASE_VALUES, pd.DataFrame({"cue": cues, "value": values}), **metadata)
    frame = pd.read_parquet(study.path / f"{BASE_VALUES}.parquet")
    values, cues = frame["value"].to_numpy(), frame["cue"].to_numpy()
    h, mape = (values[cues == cue] for cue in _CUES)
    return BaseValues(h, mape, subset)

"""Scenes of another program's traffic compared with recorded ones, scored by the metrics of the table."""

from dataclasses import replace

import numpy as np

from rearl_jax.config import EvaluateTask
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.evaluation.other_traffic import score_traffic
from tests.refusal import refused

CONFIG = EvaluateTask(eval=EvaluationConfig(n_runs=3))


def test_recorded_scenes_score_as_recorded_ones_and_slower_traffic_worse(scenes):
    same = score_traffic(scenes, scenes, CONFIG).set_index("metric")
    assert same.loc["h", "real_vs_real"] > 0.0
    slow = replace(scenes, speed=0.6 * scenes.speed)
    other = score_traffic(slow, scenes, CONFIG).set_index("metric")
    assert other.loc["h", "other_traffic"] > other.loc["h", "real_vs_real"]
    np.testing.assert_allclose(other["real_vs_real"], same["real_vs_real"])
    assert np.isfinite(other.loc["lcr", "other_traffic"])


def test_one_scene_of_other_traffic_is_compared_with_all(scenes):
    (first,) = {len(score_traffic(scenes.select(np.array([0])), scenes, CONFIG))}
    assert first == len(score_traffic(scenes, scenes, CONFIG))


def test_a_single_recorded_scene_has_no_other_one_to_compare_with(scenes):
    table = score_traffic(scenes, scenes.select(np.array([0])), CONFIG).set_index("metric")
    assert np.isfinite(table.loc["h", "other_traffic"])
    assert table["real_vs_real"].isna().all()


def test_scenes_of_another_length_are_refused(scenes):
    short = {
        name: value[:, :-1]
        for name, value in vars(scenes).items()
        if isinstance(value, np.ndarray) and value.ndim > 1 and name not in ("scaled_speed", "mean_spacing")
    }
    with refused("scenes-differ", key="scenes"):
        score_traffic(replace(scenes, **short), scenes)

"""Published figures of REARL (Bi et al.) from highD; some of their definitions are not stated in the paper.

Only the signs of differences and the order of methods can be compared with them: highD is not shipped, and the scale of
the Hellinger distance and the unit of the inference time are not stated.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class PublishedRow:
    """A row of the paper's Table 1.

    Attributes:
        title: Name of the row in the paper.
        h_legacy: Hellinger distance, on an unknown scale [-].
        mape: Relative error of the mean spacing [-].
        thw: Time headway [s].
        lcr: Lane-change rate [1/s].
    """

    title: str
    h_legacy: float
    mape: float
    thw: float
    lcr: float


TABLE1 = {
    "base": PublishedRow("Base", 0.3460, 0.8978, 7.67, 0.0081),
    "ppo": PublishedRow("PPO", 0.3258, 1.3940, 10.66, 0.0138),
    "critical": PublishedRow("CRITICAL", 0.3277, 2.0523, 7.21, 0.5630),
    "rearl_qwen3_32b": PublishedRow("REARL Qwen3-32B", 0.3067, 0.8371, 22.86, 0.0708),
    "rearl_deepseek_r1_32b": PublishedRow("REARL DeepSeek-R1-32B", 0.2562, 0.8600, 16.34, 0.0616),
    "rearl_glm_4_7_flash": PublishedRow("REARL GLM-4.7-Flash", 0.3131, 1.2099, 14.24, 0.0617),
}
"""Rows of Table 1. All Hellinger distances lie below 0.385, the factor of `metrics.histograms.legacy_scale`."""

THRESHOLDS_H = {5.0: 0.2829, 10.0: 0.3009, 20.0: 0.3192, 30.0: 0.3306}
"""Hellinger distance of base by percentile [%]: Fig. 7 and Table 3."""

THRESHOLDS_MAPE = {5.0: 0.1982, 10.0: 0.2385, 20.0: 0.3283, 30.0: 0.4242}
"""Spacing error of base by percentile [%]: Fig. 7 and Table 3."""

BEST_PAIR = (30.0, 5.0)
"""Percentiles of Hellinger distance and spacing error that the paper uses [%]."""

PARETO_PAIRS = ((30.0, 5.0), (20.0, 20.0), (20.0, 30.0))
"""Pareto-optimal pairs of Table 3."""

N_VALUES_H, N_VALUES_MAPE = 42_000, 45_000
"""Values behind Fig. 7: 150 scenes x 5 runs x 56 windows, and x 60 frames."""

N_THRESHOLD_SCENES, N_TUNING_SCENES, N_EVALUATION_SCENES, N_RUNS = 150, 15, 50, 5
"""Number of scenes by purpose, and runs of each."""

N_TRACK_CLUSTERS, N_SCENE_CLUSTERS = 3, 15
"""Clusters of tracks and of scenes; Fig. 8 shows those of the scenes."""

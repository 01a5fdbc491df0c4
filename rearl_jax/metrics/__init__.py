"""The metric table: definition, unit and direction of improvement of each metric.

The names are the columns of the result tables and the keys of their summaries. Those in `MEASURED` are measured in one
scene: fields of `rearl_jax.metrics.scene.SceneMetrics`, and further metrics, one per file of
`rearl_jax.metrics.further`. The others need all runs of a scene, or the trajectories: likelihoods come from
`rearl_jax.metrics.realism.realism_scores`, distances from `rearl_jax.metrics.paths` and `rearl_jax.metrics.energy`.
"""

from collections.abc import Iterable

from rearl_jax.metrics.further import FURTHER
from rearl_jax.metrics.metric import Direction, Metric

__all__ = ["MEASURED", "METRICS", "Direction", "Metric"]

_REARL = "REARL (Bi et al.)"
_WAYMO = "Montali et al., NeurIPS 2023; challenge_2024_config of waymo-open-dataset"
_LOWER, _HIGHER, _NONE = Direction.lower, Direction.higher, Direction.none

_OF_A_SCENE = (
    Metric(
        "h",
        "Hellinger distance",
        "1",
        _LOWER,
        "mean over the 5 s windows of the Hellinger distance of "
        "speeds to the real scene; not meaningful below the noise floor",
        f"{_REARL}, Eq. 7",
        compares=True,
    ),
    Metric(
        "h_legacy",
        "Hellinger distance, legacy scale",
        "1",
        _LOWER,
        "h times sqrt(0.5 / bin width) = 0.3849 h",
        f"inferred from the values published in {_REARL}",
        compares=True,
    ),
    Metric(
        "spacing",
        "mean spacing",
        "m",
        _NONE,
        "mean over frames of the mean distance over all pairs",
        f"{_REARL}, Eq. 9",
        digits=1,
    ),
    Metric(
        "spacing_ratio",
        "mean spacing, simulated / real",
        "1",
        _NONE,
        "mean over frames; 1 is equal",
        "own definition",
        compares=True,
    ),
    Metric(
        "mape_a",
        "spacing error A",
        "1",
        _LOWER,
        "mean over frames of |sim - real| / sim",
        f"{_REARL}, Eq. 8",
        compares=True,
    ),
    Metric(
        "mape_b",
        "spacing error B",
        "1",
        _LOWER,
        "mean over frames of |sim - real| / real",
        "Hyndman & Koehler, Int. J. Forecasting 22 (2006) 679",
        compares=True,
    ),
    Metric(
        "mape_c",
        "spacing error C",
        "1",
        _LOWER,
        "mean over frames of mean_j |real_j - sim| / real; cannot reach 0",
        f"inferred from the percentiles published in {_REARL}",
        compares=True,
    ),
    Metric(
        "thw",
        "time headway, mean",
        "s",
        _NONE,
        "mean of gap / speed over same-lane leader-follower pairs of "
        "all frames, speed >= thw.v_min (1 m/s), none crashed, gap > 0, any distance",
        _REARL,
        needs_lanes=True,
        digits=2,
    ),
    Metric(
        "thw_median",
        "time headway, median",
        "s",
        _NONE,
        "median over the same pairs",
        "own definition",
        needs_lanes=True,
        digits=2,
    ),
    Metric(
        "thw_excluded",
        "pairs without time headway",
        "1",
        _NONE,
        "share of leader-follower pairs that are too slow, crashed or overlapping",
        "own definition",
        needs_lanes=True,
    ),
    Metric(
        "lcr",
        "lane-change rate",
        "1/s",
        _NONE,
        "lane changes / (frames x vehicles), frames 1 s apart",
        _REARL,
        needs_lanes=True,
        digits=4,
    ),
    Metric(
        "lcr_observed",
        "lane-change rate, observed",
        "1/s",
        _NONE,
        "lane changes per observed vehicle-second (frames 1 s apart); compares recorded with simulated scenes",
        "own definition",
        needs_lanes=True,
        digits=4,
    ),
    Metric("collisions", "crashed vehicles", "1", _LOWER, "share of vehicles crashed when last simulated", _REARL),
    Metric(
        "any_collision", "scenes with a crash", "1", _LOWER, "1 if any vehicle crashed in any frame", "own definition"
    ),
    Metric(
        "jerk_rms",
        "jerk, root mean square",
        "m/s^3",
        _NONE,
        "of the second difference of the speed at 1 Hz",
        "own definition; named as future work in REARL (Bi et al.)",
    ),
    Metric("jerk_share", "large jerk", "1", _NONE, "share of |jerk| > safety.jerk (2.5 m/s^3)", "ISO 15622:2018"),
    Metric(
        "ttc_min",
        "least time to collision",
        "s",
        _NONE,
        "least gap / approach rate over closing pairs",
        "Hayward, Highway Research Record 384 (1972) 24",
        needs_lanes=True,
        digits=1,
    ),
    Metric(
        "ttc_share",
        "short time to collision",
        "1",
        _NONE,
        "share of pairs with less than safety.ttc (1.5 s)",
        "Minderhoud & Bovy (2001); threshold FHWA-HRT-08-051 (2008)",
        needs_lanes=True,
        digits=4,
    ),
    Metric(
        "drac_share",
        "hard deceleration to avoid a crash",
        "1",
        _NONE,
        "share of pairs with (approach rate)^2 / (2 gap) > safety.drac (3.35 m/s^2)",
        "Cooper & Ferguson (1976); threshold Archer (2005)",
        needs_lanes=True,
        digits=4,
    ),
    Metric(
        "critical_share",
        "safety-critical events",
        "1",
        _NONE,
        "share of pairs with short time to collision or hard deceleration to avoid a crash",
        "union of the two",
        needs_lanes=True,
        digits=4,
    ),
)

_OF_SCENES = (
    Metric(
        "realism",
        "realism",
        "1",
        _HIGHER,
        "weighted mean of the likelihoods of the real scene's speed, "
        "acceleration, nearest distance, time to collision and collision under the simulated ones",
        _WAYMO,
        compares=True,
        needs_lanes=True,
    ),
    Metric(
        "ttc_likelihood",
        "likelihood of times to collision",
        "1",
        _HIGHER,
        "likelihood of the real scene's times to collision (at most 5 s, all vehicles and frames) under the histogram "
        "of the simulated ones: exp of the mean log share, runs pooled",
        _WAYMO,
        compares=True,
        needs_lanes=True,
    ),
    Metric(
        "thw_likelihood",
        "likelihood of time headways",
        "1",
        _HIGHER,
        "the same for the time headways of the pairs of thw",
        f"estimator: {_WAYMO}; bins: realism.headway",
        compares=True,
        needs_lanes=True,
    ),
    Metric(
        "displacement",
        "displacement",
        "m",
        _LOWER,
        "mean distance of a vehicle from its partner in the real scene, over vehicles and seconds; paired by the order "
        "along the road in the first snapshot; only the vehicles of this snapshot count, as long as they are picked",
        "average displacement error of Montali et al., NeurIPS 2023; pairing of this project",
        compares=True,
        needs_lanes=True,
        digits=1,
    ),
    Metric(
        "frechet",
        "Frechet distance of trajectories",
        "m",
        _LOWER,
        "mean over the same pairs of vehicles of the discrete Frechet distance of their trajectories; the times at "
        "which they pass a position do not matter",
        "Eiter & Mannila, TU Wien report CD-TR 94/64 (1994)",
        compares=True,
        needs_lanes=True,
        digits=1,
    ),
    Metric(
        "energy_score",
        "energy score",
        "m",
        _LOWER,
        "mean displacement of the runs of a scene less half their mean displacement from each other; needs two runs",
        "Gneiting & Raftery, J. Am. Stat. Assoc. 102 (2007) 359",
        compares=True,
        needs_lanes=True,
        digits=1,
    ),
)


def _by_name(metrics: Iterable[Metric]) -> dict[str, Metric]:
    named: dict[str, Metric] = {}
    for metric in metrics:
        if named.setdefault(metric.name, metric) is not metric:
            raise ValueError(f"two metrics are called {metric.name}: rename the one in rearl_jax/metrics/further")
    return named


METRICS = _by_name((*_OF_A_SCENE, *_OF_SCENES, *FURTHER))
"""Every metric by its name."""

MEASURED = tuple(metric.name for metric in (*_OF_A_SCENE, *FURTHER))
"""Names of the metrics that are measured in one scene, and of every single run."""

"""Likelihood of recorded traffic under simulated traffic: highway subset of the Waymo Sim Agents measures.

Waymo estimates, for every logged vehicle, how likely its logged values are under the distribution of the same
vehicle's values in 32 simulations; the meta-metric is the weighted mean of the likelihoods of nine features
(ten from 2025 on). Similarities and differences here:

- Features: linear speed, linear acceleration, distance to the nearest object, time to collision, collision. The two
  angular features, the two map features and the traffic-light feature carry no information on a straight carriageway.
- One more feature, the time headway of the pairs of the metric `thw`, is scored in the same way. Waymo does not
  score it, so its weight in the mean is 0.
- Our simulations share no vehicles with the recording, so a scene's simulated values are pooled over
  vehicles, frames and runs, and all its recorded values are scored under this one histogram. Waymo's
  scenario-generation challenge pools in the same way (`aggregate_objects: true`, with `independent_timesteps:
  true`).
- Likelihood of a feature = exp(mean over recorded values of log p(bin)), p = (count + pseudocount) / total,
  values outside the range in the outer bins. It depends on the values only through their bin counts, so
  only counts are kept of a rollout, and the counts of runs are added.
- The weights of the five features are divided by their sum (0.05 + 0.05 + 0.1 + 0.1 + 0.25 = 0.55).
- Speeds reach 32 m/s and more here; the range is [0, 35] m/s as in the 2023 challenge, not [0, 25] as from
  2024 on.
- Frames are 1 s apart (Waymo: 0.1 s): acceleration is the backward difference of the speed over 1 s.
- Objects are the selected vehicles, as rectangles along the road; the leader is the one in the same lane.

Source: Montali et al., "The Waymo Open Sim Agents Challenge", NeurIPS 2023 Datasets and Benchmarks; bins,
pseudocounts and weights: configurations `challenge_2023_config`, `challenge_2024_config` and
`challenge_2025_scenario_gen_config` of github.com/waymo-research/waymo-open-dataset.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.config.metrics import FeatureConfig, MetricsConfig, RealismConfig, SpeedValues
from rearl_jax.metrics.following import Followers
from rearl_jax.metrics.histograms import cumulative_counts, equal_edges
from rearl_jax.metrics.measure import Measure, fold_vehicles, unrolled_sum
from rearl_jax.metrics.motion import Rates
from rearl_jax.metrics.safety import pair_headways, time_to_collision


class RealismCounts(eqx.Module):
    """Bin counts of the features of a scene; those of several runs can be added.

    The two bins of `collision` count the vehicles that never crashed and those that crashed.
    """

    speed: Int[Array, " speed_bins *scenarios"]
    acceleration: Int[Array, " acceleration_bins *scenarios"]
    distance: Int[Array, " distance_bins *scenarios"]
    ttc: Int[Array, " ttc_bins *scenarios"]
    headway: Int[Array, " headway_bins *scenarios"]
    collision: Int[Array, " 2 *scenarios"]


class Realism(eqx.Module):
    """Likelihoods in [0, 1] with the number of recorded values scored.

    `meta` is the weighted mean of the features that have values; its count is their number.
    """

    meta: Measure
    speed: Measure
    acceleration: Measure
    distance: Measure
    ttc: Measure
    headway: Measure
    collision: Measure


def distance_to_nearest(
    x: Float[Array, "steps vehicles *scenarios"],
    y: Float[Array, "steps vehicles *scenarios"],
    length: Float[Array, "steps vehicles *scenarios"],
    width: Float[Array, "steps vehicles *scenarios"],
) -> Float[Array, "steps vehicles *scenarios"]:
    """Signed distance of each vehicle's rectangle to the nearest other one [m]; inf if there is only one vehicle.

    Rectangles stand along the road (a heading of 5 degrees shifts a corner by 0.2 m). Negative if they overlap: minus
    the shortest shift that separates them.

    Args:
        x: Centre along the road in the ground frame [m].
        y: Centre across the road in the ground frame [m].
        length: Vehicle length [m].
        width: Vehicle width [m].

    Source: Montali et al. (2023): signed distance between two boxes through their Minkowski sum.
    """
    slots = jnp.arange(x.shape[1]).reshape((1, -1) + (1,) * (x.ndim - 2))

    # Carried are the least squared distance of separate rectangles, whose root is taken once at the end, and the
    # deepest overlap, which counts if any rectangle overlaps.
    def nearer_of(best, slot, pick):
        over_x = jnp.abs(pick(x) - x) - (pick(length) + length) / 2
        over_y = jnp.abs(pick(y) - y) - (pick(width) + width) / 2
        square = jnp.maximum(over_x, 0) ** 2 + jnp.maximum(over_y, 0) ** 2
        candidate = (square, jnp.maximum(over_x, over_y))
        pairs = zip(candidate, best, strict=True)
        return tuple(jnp.where(slots == slot, old, jnp.minimum(old, new)) for new, old in pairs)

    no_vehicle = (jnp.full_like(x, jnp.inf), jnp.zeros_like(x))
    square, overlap = fold_vehicles(nearer_of, no_vehicle, x.shape[1])
    apart = square > 0
    return jnp.where(apart, jnp.sqrt(jnp.where(apart, square, 1)), overlap)


def feature_counts(
    values: Float[Array, "steps vehicles *scenarios"],
    feature: FeatureConfig,
    valid: Bool[Array, "steps vehicles *scenarios"] | None = None,
) -> Int[Array, " bins *scenarios"]:
    """Bin counts over frames and vehicles; values outside the range fall into the outer bins."""
    edges = equal_edges(feature.low, feature.high, feature.n_bins)
    return cumulative_counts(values, edges, drop=False, valid=valid)[-1]


def realism_counts(
    speed: Float[Array, "steps vehicles *scenarios"],
    scaled_speed: Float[Array, "steps vehicles *scenarios"],
    acceleration: Rates,
    distance: Float[Array, "steps vehicles *scenarios"],
    followers: Followers,
    crashed: Bool[Array, "steps vehicles *scenarios"],
    config: MetricsConfig,
) -> RealismCounts:
    """Bin counts of the features of one scene; as in Waymo's measures, crashed vehicles count, except in headways.

    Args:
        speed: Speed of the vehicles [m/s].
        scaled_speed: Speed rescaled to the simulator's range [m/s].
        acceleration: `rate_of_change` of the unscaled speed [m/s^2].
        distance: Result of `distance_to_nearest` [m].
        followers: Result of `find_leaders`.
        crashed: Whether the vehicle has crashed.
        config: Bins of the features, and valid pairs of headways.
    """
    realism = config.realism
    compared = speed if realism.speed_values is SpeedValues.raw else scaled_speed
    headway, is_pair = pair_headways(followers, speed, crashed, config.thw)
    n_ever_crashed = jnp.sum(jnp.any(crashed, axis=0), axis=0, dtype=jnp.int32)
    return RealismCounts(
        speed=feature_counts(compared, realism.speed),
        acceleration=feature_counts(acceleration.value, realism.acceleration, acceleration.valid),
        distance=feature_counts(distance, realism.distance),
        ttc=feature_counts(time_to_collision(followers, cap=realism.ttc.high), realism.ttc),
        headway=feature_counts(headway, realism.headway, is_pair),
        collision=jnp.stack([crashed.shape[1] - n_ever_crashed, n_ever_crashed]),
    )


def likelihood(
    simulated: Int[Array, " bins *scenarios"],
    recorded: Int[Array, " bins *scenarios"],
    pseudocount: float,
    dtype: jnp.dtype,
) -> Measure:
    """Likelihood exp(mean over recorded values of log p(bin)), with p the smoothed simulated histogram.

    The count is the number of recorded values, and 0 if there are no simulated values.

    Args:
        simulated: Bin counts of the simulation, summed over its runs.
        recorded: Bin counts of the recorded scene.
        pseudocount: Added to every simulated bin.
        dtype: Floating-point type of the result.

    Source: Montali et al. (2023).
    """
    smoothed = simulated.astype(dtype) + pseudocount
    log_p = jnp.log(smoothed) - jnp.log(unrolled_sum(smoothed, 0))[None]
    n_recorded = jnp.where(unrolled_sum(simulated, 0) > 0, unrolled_sum(recorded, 0), 0)
    mean_log = unrolled_sum(recorded.astype(dtype) * log_p, 0) / jnp.maximum(n_recorded, 1).astype(dtype)
    return Measure(jnp.where(n_recorded > 0, jnp.exp(mean_log), 0), n_recorded)


def realism_scores(
    simulated: RealismCounts, recorded: RealismCounts, realism: RealismConfig, dtype: jnp.dtype
) -> Realism:
    """Likelihoods of a recorded scene's features under the simulated scene, and their weighted mean.

    Weights are renormalised over the features that have values. To score a recording as if it were
    simulated, pass its counts as `simulated`.

    Args:
        simulated: Counts of the simulation, summed over its runs.
        recorded: Counts of the recorded scene.
        realism: Pseudocounts and weights.
        dtype: Floating-point type of the result.
    """
    names = ("speed", "acceleration", "distance", "ttc", "headway")
    weights = {name: getattr(realism, name).weight for name in names} | {"collision": realism.collision_weight}
    smoothing = {name: realism.pseudocount for name in names} | {"collision": realism.collision_pseudocount}
    scores = {
        name: likelihood(getattr(simulated, name), getattr(recorded, name), pseudocount, dtype)
        for name, pseudocount in smoothing.items()
    }
    values = jnp.stack([score.value for score in scores.values()])
    used = jnp.stack([jnp.where(score.count > 0, weights[name], 0).astype(dtype) for name, score in scores.items()])
    total = unrolled_sum(used, 0)
    meta = jnp.where(total > 0, unrolled_sum(used * values, 0) / jnp.where(total > 0, total, 1), 0)
    return Realism(meta=Measure(meta, unrolled_sum((used > 0).astype(jnp.int32), 0)), **scores)

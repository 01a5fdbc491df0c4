"""All metrics of one scene, simulated or recorded, in one call.

Every kernel, a function that computes a metric, takes arrays of one scene, "steps vehicles", and may be mapped with
`jax.vmap`. Trailing axes are carried along unchanged, so a batch with the scenario axis last needs no `vmap` at all;
that is the fast way.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from rearl_jax.config.metrics import HistConfig, MetricsConfig
from rearl_jax.metrics.following import find_leaders
from rearl_jax.metrics.further import KERNELS
from rearl_jax.metrics.histograms import cumulative_speed_counts, legacy_scale, window_distances
from rearl_jax.metrics.measure import Measure, frame_mean
from rearl_jax.metrics.motion import jerk_statistics, lane_changes, rate_of_change
from rearl_jax.metrics.realism import RealismCounts, distance_to_nearest, realism_counts
from rearl_jax.metrics.safety import collisions, conflicts, time_headways
from rearl_jax.metrics.spacing import mean_spacing, spacing_errors, vehicle_spacing
from rearl_jax.metrics.trajectories import SceneReference, Trajectories

VEHICLE_WIDTH = 2.0
"""Width of every highway-env vehicle [m]. Source: highway-env 1.12.1, vehicle/objects.py."""


class SceneSeries(eqx.Module):
    """Figures per window (h) or frame; where a `valid` is false, the values are placeholders of 0."""

    h: Float[Array, " windows *scenarios"]
    h_valid: Bool[Array, " windows *scenarios"]
    mape_a: Float[Array, " steps *scenarios"]
    mape_b: Float[Array, " steps *scenarios"]
    mape_c: Float[Array, " steps *scenarios"]
    mape_valid: Bool[Array, " steps *scenarios"]
    spacing: Float[Array, " steps *scenarios"]


class SceneMetrics(eqx.Module):
    """Metrics of one scene, the rows of `rearl_jax.metrics.METRICS`: fields, and those of further metrics by name."""

    h: Measure
    h_legacy: Measure
    spacing: Measure
    spacing_ratio: Measure
    mape_a: Measure
    mape_b: Measure
    mape_c: Measure
    thw: Measure
    thw_median: Measure
    thw_excluded: Measure
    lcr: Measure
    lcr_observed: Measure
    collisions: Measure
    any_collision: Measure
    jerk_rms: Measure
    jerk_share: Measure
    ttc_min: Measure
    ttc_share: Measure
    drac_share: Measure
    critical_share: Measure
    realism: RealismCounts
    series: SceneSeries
    further: dict[str, Measure]

    def measure(self, name: str) -> Measure:
        """The measure of a metric by name; a single scene has none of `realism`."""
        return self.further[name] if name in self.further else getattr(self, name)


def scene_reference(
    scaled_speed: Float[Array, "steps vehicles *scenarios"],
    mean: Float[Array, " steps *scenarios"],
    vehicle: Float[Array, "steps vehicles *scenarios"],
    hist: HistConfig,
) -> SceneReference:
    """Reference made of a recorded scene's scaled speeds [m/s], mean spacing [m] and spacing of each vehicle [m]."""
    return SceneReference(cumulative_speed_counts(scaled_speed, hist), mean, vehicle)


def scene_metrics(scene: Trajectories, reference: SceneReference, config: MetricsConfig) -> SceneMetrics:
    """All metrics of a scene, and per-frame series for detection and figures.

    Args:
        scene: The simulated scene, or a recorded one scored as if it were simulated.
        reference: The recorded scene that it is compared with, with as many frames.
        config: Bins, thresholds and switches; static under `jax.jit`.
    """
    dtype, dt = scene.speed.dtype, config.frame_interval
    counts = cumulative_speed_counts(scene.scaled_speed, config.hist)
    distances = window_distances(counts, reference.cumulative_counts, config.hist, dtype)
    h = frame_mean(distances.value, distances.valid)
    spacing = mean_spacing(vehicle_spacing(scene.x, scene.y, config.spacing))
    errors = spacing_errors(spacing, reference.mean_spacing, reference.vehicle_spacing)
    followers = find_leaders(scene.position, scene.speed, scene.lane, scene.length, scene.crashed, scene.direction)
    headways = time_headways(followers, scene.speed, scene.crashed, config.thw)
    pairs = conflicts(followers, scene.crashed, config.safety)
    acceleration = rate_of_change(scene.speed, scene.track_id, dt)
    jerk = jerk_statistics(acceleration, scene.crashed, scene.track_id, dt, config.safety.jerk)
    changes = lane_changes(scene.lane, scene.crashed, scene.track_id, dtype)
    crashes = collisions(scene.crashed, scene.n_crashed_replaced, scene.track_id, dtype)
    return SceneMetrics(
        h=h,
        h_legacy=Measure(h.value * legacy_scale(config.hist), h.count),
        spacing=frame_mean(spacing, jnp.ones(spacing.shape, bool)),
        spacing_ratio=frame_mean(errors.ratio, errors.valid),
        mape_a=frame_mean(errors.a, errors.valid),
        mape_b=frame_mean(errors.b, errors.valid),
        mape_c=frame_mean(errors.c, errors.valid),
        thw=headways.mean,
        thw_median=headways.median,
        thw_excluded=headways.excluded,
        lcr=changes.rate,
        lcr_observed=changes.observed_rate,
        collisions=crashes.share,
        any_collision=crashes.any,
        jerk_rms=jerk.rms,
        jerk_share=jerk.share,
        ttc_min=pairs.ttc_min,
        ttc_share=pairs.ttc_share,
        drac_share=pairs.drac_share,
        critical_share=pairs.critical_share,
        realism=realism_counts(
            scene.speed,
            scene.scaled_speed,
            acceleration,
            distance_to_nearest(scene.x, scene.y, scene.length, scene.width),
            followers,
            scene.crashed,
            config,
        ),
        series=SceneSeries(distances.value, distances.valid, errors.a, errors.b, errors.c, errors.valid, spacing),
        further={name: measure(scene, reference, config) for name, measure in KERNELS.items()},
    )

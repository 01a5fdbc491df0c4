"""Mean spacing between the vehicles of a frame and its relative errors against a recorded scene."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from rearl_jax.config.scenes import SpacingConfig, SpacingMetric
from rearl_jax.metrics.measure import fold_vehicles, safe_sqrt, unrolled_sum


class SpacingErrors(eqx.Module):
    """Relative errors of the mean spacing per frame under three definitions.

    `valid` is false if a mean spacing is 0 (one vehicle, or all at one position): the errors are then undefined and set
    to 0.
    """

    a: Float[Array, " steps *scenarios"]
    b: Float[Array, " steps *scenarios"]
    c: Float[Array, " steps *scenarios"]
    ratio: Float[Array, " steps *scenarios"]
    valid: Bool[Array, " steps *scenarios"]


def vehicle_spacing(
    x: Float[Array, "steps vehicles *scenarios"],
    y: Float[Array, "steps vehicles *scenarios"],
    spacing: SpacingConfig,
) -> Float[Array, "steps vehicles *scenarios"]:
    """Mean distance of each vehicle's centre to the centres of the others [m]; 0 if there is only one vehicle.

    Args:
        x: Position along the road in the ground frame [m].
        y: Position across the road in the ground frame [m].
        spacing: Euclidean distance or |x_i - x_j|.

    Source: REARL (Bi et al.), Eq. 9: the spacing d of a vehicle.
    """
    longitudinal = spacing.metric is SpacingMetric.longitudinal

    def add_distance(total, slot, pick):
        dx, dy = pick(x) - x, pick(y) - y
        return total + (jnp.abs(dx) if longitudinal else safe_sqrt(dx * dx + dy * dy))

    total = fold_vehicles(add_distance, jnp.zeros_like(x), x.shape[1])
    return total / max(x.shape[1] - 1, 1)


def mean_spacing(spacing: Float[Array, "steps vehicles *scenarios"]) -> Float[Array, " steps *scenarios"]:
    """Mean distance over all pairs of a frame [m], 45 pairs for ten vehicles.

    Every pair appears in the spacing of two vehicles and every vehicle in equally many pairs, so the mean
    over the pairs is the mean over the vehicles.

    Args:
        spacing: Result of `vehicle_spacing` [m].

    Source: REARL (Bi et al.): all selected vehicles count, crashed ones too.
    """
    return unrolled_sum(spacing, 1) / spacing.shape[1]


def spacing_errors(
    mean: Float[Array, " steps *scenarios"],
    real_mean: Float[Array, " steps *scenarios"],
    real_spacing: Float[Array, "steps vehicles *scenarios"],
) -> SpacingErrors:
    """Relative errors of the mean spacing per frame, and the ratio simulated / recorded.

    A = |d_sim - d_real| / d_sim,  B = |d_sim - d_real| / d_real,  C = mean_j |d_real_j - d_sim| / d_real,
    with d_sim and d_real the mean over pairs in the simulated and in the recorded scene, and d_real_j the spacing of
    recorded vehicle j. A saturates at 1 when the simulation spreads out; C cannot reach 0 because the recorded vehicles
    differ among themselves.

    Args:
        mean: Mean spacing of the simulation [m].
        real_mean: Mean spacing of the recorded scene [m].
        real_spacing: Spacing of each recorded vehicle [m].

    Source: A is REARL (Bi et al.), Eq. 8 read literally with y = simulation; B is the usual form with the
    observation in the denominator (Hyndman & Koehler, Int. J. Forecasting 22 (2006) 679); C is the
    per-vehicle form that fits the percentiles published in REARL.
    """
    valid = (mean > 0) & (real_mean > 0)
    sim, real = (jnp.where(valid, d, 1) for d in (mean, real_mean))
    error = jnp.abs(sim - real)
    deviation = unrolled_sum(jnp.abs(real_spacing - sim[:, None]), 1) / real_spacing.shape[1]
    values = (error / sim, error / real, deviation / real, sim / real)
    return SpacingErrors(*(jnp.where(valid, value, 0) for value in values), valid=valid)

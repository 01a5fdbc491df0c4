"""Changes of a vehicle between frames: acceleration, jerk and lane changes."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Shaped

from rearl_jax.metrics.measure import Measure, ratio, safe_sqrt, scene_count, scene_mean, share_of


class Rates(eqx.Module):
    """Rates of change from the frame before, for each frame but the first; 0 where not `valid` (no frame before)."""

    value: Float[Array, "intervals vehicles *scenarios"]
    valid: Bool[Array, "intervals vehicles *scenarios"]


class JerkStatistics(eqx.Module):
    """Root mean square of the jerk [m/s^3] and share of large jerk."""

    rms: Measure
    share: Measure


class LaneChanges(eqx.Module):
    """Lane changes per vehicle and frame (`rate`), and per pair of frames in which a vehicle was observed."""

    rate: Measure
    observed_rate: Measure


def previous_values(
    values: Shaped[Array, "steps vehicles *scenarios"],
    track_id: Int[Array, "steps vehicles *scenarios"] | None,
) -> tuple[Shaped[Array, "steps-1 vehicles *scenarios"], Bool[Array, "steps-1 vehicles *scenarios"]]:
    """Value of the same vehicle one frame earlier, and whether there is one.

    Args:
        values: Any quantity per frame and slot.
        track_id: Id of the vehicle in each slot, unique within a frame; None if it never changes. In recordings the
            selected vehicles and their order change from frame to frame.
    """
    earlier = values[:-1]
    if track_id is None:
        return earlier, jnp.ones(earlier.shape, bool)
    is_there, previous = jnp.zeros(earlier.shape, bool), jnp.zeros_like(earlier)
    for slot in range(values.shape[1]):
        same = track_id[:-1, slot : slot + 1] == track_id[1:]
        is_there, previous = is_there | same, jnp.where(same, earlier[:, slot : slot + 1], previous)
    return previous, is_there


def rate_of_change(
    values: Float[Array, "steps vehicles *scenarios"],
    track_id: Int[Array, "steps vehicles *scenarios"] | None,
    frame_interval: float,
    *,
    known: Bool[Array, "steps vehicles *scenarios"] | None = None,
) -> Rates:
    """Rates (value now - value of the same vehicle one frame earlier) / frame interval.

    Args:
        values: Quantity to differentiate.
        track_id: Id of the vehicle in each slot; None if it never changes.
        frame_interval: Time between frames [s].
        known: Mask of the values of the quantity that are known; None if all are.
    """
    previous, valid = previous_values(values, track_id)
    if known is not None:
        was_known, _ = previous_values(known, track_id)
        valid = valid & known[1:] & was_known
    return Rates(jnp.where(valid, (values[1:] - previous) / frame_interval, 0), valid)


def jerk_statistics(
    acceleration: Rates,
    crashed: Bool[Array, "steps vehicles *scenarios"],
    track_id: Int[Array, "steps vehicles *scenarios"] | None,
    frame_interval: float,
    threshold: float,
) -> JerkStatistics:
    """Root mean square of the jerk and share of |jerk| > threshold.

    Jerk is the second difference of the speed, (v_t - 2 v_(t-1) + v_(t-2)) / frame_interval^2: the change
    over one frame of the mean acceleration within a frame. It is taken from speeds, not from accelerations,
    so that simulated and recorded scenes are treated alike. Vehicles crashed in the last of the three frames
    do not count.

    Args:
        acceleration: `rate_of_change` of the speed [m/s^2].
        crashed: Whether the vehicle has crashed.
        track_id: Id of the vehicle in each slot; None if it never changes.
        frame_interval: Time between frames [s].
        threshold: Large jerk [m/s^3], positive.

    Source: threshold from ISO 15622:2018 (adaptive cruise control), which also averages the jerk over one
    second.
    """
    ids = None if track_id is None else track_id[1:]
    jerk = rate_of_change(acceleration.value, ids, frame_interval, known=acceleration.valid)
    valid = jerk.valid & ~crashed[2:]
    mean_square = scene_mean(jerk.value**2, valid)
    share = share_of(jnp.abs(jerk.value) > threshold, valid, jerk.value.dtype)
    return JerkStatistics(Measure(safe_sqrt(mean_square.value), mean_square.count), share)


def lane_changes(
    lane: Int[Array, "steps vehicles *scenarios"],
    crashed: Bool[Array, "steps vehicles *scenarios"],
    track_id: Int[Array, "steps vehicles *scenarios"] | None,
    dtype: jnp.dtype,
) -> LaneChanges:
    """Lane-change rates, both in [0, 1].

    rate = #(lane differs between frames i and i+1, not crashed at i+1) / (frames x vehicles);
    observed_rate divides the same number by the observed pairs of frames, those in which the vehicle is present and not
    crashed; it also compares recorded scenes, whose vehicles leave, with simulated ones. The count of both measures is
    the number of observed pairs.

    Args:
        lane: Lane index.
        crashed: Whether the vehicle has crashed.
        track_id: Id of the vehicle in each slot; None if it never changes.
        dtype: Floating-point type of the result.

    Source: REARL (Bi et al.): lane-change rate, clipped to [0, 1]; the denominator uses all 60 frames.
    """
    previous, is_known = previous_values(lane, track_id)
    observed = is_known & ~crashed[1:]
    n_changes, n_observed = scene_count((previous != lane[1:]) & observed), scene_count(observed)
    rate = n_changes.astype(dtype) / (lane.shape[0] * lane.shape[1])
    return LaneChanges(Measure(jnp.clip(rate, 0, 1), n_observed), ratio(n_changes, n_observed, dtype))

"""Speed histograms over a sliding window and the Hellinger distance between them."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax._typing import PRNGKey
from rearl_jax.config.metrics import HistConfig, OutOfBounds
from rearl_jax.metrics.measure import safe_sqrt, unrolled_sum


class Distances(eqx.Module):
    """Distances per window; if `valid` is false a histogram was empty, and the value 0 is a placeholder."""

    value: Float[Array, "*windows"]
    valid: Bool[Array, "*windows"]


def equal_edges(low: float, high: float, n_bins: int) -> tuple[float, ...]:
    """Edges of equal bins, the last one exactly `high`."""
    return (*(low + (high - low) * i / n_bins for i in range(n_bins)), high)


def bin_counts(
    values: Float[Array, " vehicles *scenarios"],
    edges: tuple[float, ...],
    *,
    drop: bool,
    valid: Bool[Array, " vehicles *scenarios"] | None = None,
) -> Int[Array, " bins *scenarios"]:
    """Number of values per bin.

    Bins are closed on the left, the last one on both sides, as in `numpy.histogram`. A value that is
    not a number is in no bin.

    Args:
        values: Values of one frame.
        edges: Edges of the bins, ascending.
        drop: Leave out values outside the edges, instead of counting them in the outer bins.
        valid: Mask of the values that count; None for all.
    """
    lower = jnp.asarray([edges[0] if drop else -jnp.inf, *edges[1:-1]], values.dtype)
    at_least = values[:, None] >= lower.reshape(1, -1, *(1,) * (values.ndim - 1))
    beyond = values[:, None] > (edges[-1] if drop else jnp.inf)
    marks = [mark if valid is None else mark & valid[:, None] for mark in (at_least, beyond)]
    counts = jnp.concatenate([unrolled_sum(mark.astype(jnp.int32), 0) for mark in marks])
    return counts[:-1] - counts[1:]


def cumulative_counts(
    values: Float[Array, "steps vehicles *scenarios"],
    edges: tuple[float, ...],
    *,
    drop: bool,
    valid: Bool[Array, "steps vehicles *scenarios"] | None = None,
) -> Int[Array, "steps+1 bins *scenarios"]:
    """Number of values per bin before each frame: row t counts frames 0 .. t-1, so row 0 is empty.

    The histogram of frames i .. j is the difference of rows j+1 and i.

    Args:
        values: Values per frame and vehicle.
        edges: Edges of the bins, ascending.
        drop: Leave out values outside the edges, instead of counting them in the outer bins.
        valid: Mask of the values that count; None for all.
    """

    # A loop over frames, because XLA computes the input of a loop once; otherwise it would do so again for every bin.
    def add_frame(counts, frame):
        counts = counts + bin_counts(frame[0], edges, drop=drop, valid=frame[1])
        return counts, counts

    empty = jnp.zeros((len(edges) - 1, *values.shape[2:]), jnp.int32)
    _, rows = jax.lax.scan(add_frame, empty, (values, valid))
    return jnp.concatenate([empty[None], rows])


def speed_edges(hist: HistConfig) -> tuple[float, ...]:
    """Edges of the speed bins [m/s].

    Source: REARL (Bi et al.): eight equal bins on [5, 32] m/s, the range of DiLu's nine target speeds.
    """
    return equal_edges(hist.low, hist.high, hist.n_bins)


def speed_counts(speed: Float[Array, " vehicles *scenarios"], hist: HistConfig) -> Int[Array, " bins *scenarios"]:
    """Number of vehicles per speed bin in one frame.

    Args:
        speed: Speed [m/s], scaled if it comes from a recording.
        hist: Bins and treatment of values outside them.
    """
    return bin_counts(speed, speed_edges(hist), drop=hist.oob is OutOfBounds.drop)


def cumulative_speed_counts(
    speed: Float[Array, "steps vehicles *scenarios"], hist: HistConfig
) -> Int[Array, "steps+1 bins *scenarios"]:
    """Number of speeds per bin before each frame, see `cumulative_counts`.

    A caller that has one frame at a time gets the next row by adding `speed_counts` to the last row.
    """
    return cumulative_counts(speed, speed_edges(hist), drop=hist.oob is OutOfBounds.drop)


def window_counts(cumulative: Int[Array, "rows bins *scenarios"], window: int) -> Int[Array, "windows bins *scenarios"]:
    """Histograms of all windows of `window` frames, oldest first; the first ends at frame window - 1.

    60 frames and a window of 5 give the 56 windows of REARL (Bi et al.).

    Raises:
        ValueError: The window is longer than the scene or has no frame.
    """
    n_frames = cumulative.shape[0] - 1
    if not 1 <= window <= n_frames:
        raise ValueError(f"the window must have 1 to {n_frames} frames, as many as the scene, got {window}")
    return cumulative[window:] - cumulative[:-window]


def hellinger_distance(
    p: Float[Array, " bins *scenarios"], q: Float[Array, " bins *scenarios"]
) -> Float[Array, "*scenarios"]:
    """Hellinger distance of two distributions, in [0, 1]; symmetric, exactly 0 of a distribution to itself.

    H(p, q) = sqrt( sum_b (sqrt p_b - sqrt q_b)^2 / 2 ).

    Args:
        p: Shares that sum to 1 over the bins.
        q: Shares that sum to 1 over the bins.

    Source: REARL (Bi et al.), Eq. 7.
    """
    half_square = unrolled_sum((safe_sqrt(p) - safe_sqrt(q)) ** 2, 0) / 2
    # Rounding may give 1 + 1e-7 for disjoint distributions.
    return jnp.minimum(safe_sqrt(half_square), 1)


def histogram_distances(
    counts: Int[Array, " bins *windows"], reference: Int[Array, " bins *windows"], dtype: jnp.dtype
) -> Distances:
    """Hellinger distances between histograms given as counts.

    Args:
        counts: Counts of the simulation.
        reference: Counts of the recorded scene.
        dtype: Floating-point type of the result.
    """
    totals = [unrolled_sum(c, 0) for c in (counts, reference)]
    p, q = (
        c.astype(dtype) / jnp.maximum(total, 1).astype(dtype)[None]
        for c, total in zip((counts, reference), totals, strict=True)
    )
    valid = (totals[0] > 0) & (totals[1] > 0)
    return Distances(jnp.where(valid, hellinger_distance(p, q), 0), valid)


def window_distances(
    cumulative: Int[Array, "rows bins *scenarios"],
    reference: Int[Array, "rows bins *scenarios"],
    hist: HistConfig,
    dtype: jnp.dtype,
) -> Distances:
    """Hellinger distances of all windows between two scenes given as cumulative counts, oldest first."""
    counts, reference_counts = (jnp.moveaxis(window_counts(c, hist.window), 1, 0) for c in (cumulative, reference))
    return histogram_distances(counts, reference_counts, dtype)


def legacy_scale(hist: HistConfig) -> float:
    """Factor from the Hellinger distance to that of histograms that are densities times 0.5 m/s.

    sqrt(0.5 / bin width), 0.3849 for eight bins on [5, 32] m/s. The published values of REARL (Bi et al.)
    stay below this factor, which fits histograms that were normalised for bins 0.5 m/s wide; this is inferred from
    the numbers, not stated there.
    """
    return math.sqrt(0.5 * hist.n_bins / (hist.high - hist.low))


def noise_floor(
    shares: Float[Array, " bins"], *, n_samples: int = 50, n_draws: int = 1000, key: PRNGKey
) -> Float[Array, " draws"]:
    """Hellinger distances between two independent samples of one distribution.

    Below the mean of these distances no method can be distinguished from the recorded traffic.

    Args:
        shares: The distribution; sums to 1.
        n_samples: Size of each sample; ten vehicles in five frames give 50, REARL (Bi et al.).
        n_draws: Number of pairs of samples.
        key: Random key.
    """
    # In one row, because XLA would unroll a loop over a short last axis and take ten times as long to compile.
    drawn = jax.random.choice(key, shares.shape[0], (2 * n_draws * n_samples,), p=shares)
    drawn = drawn.reshape(2, n_draws, n_samples)
    counts = jnp.stack([jnp.sum(drawn == b, axis=-1, dtype=jnp.int32) for b in range(shares.shape[0])])
    first, second = jnp.moveaxis(counts.astype(shares.dtype) / n_samples, 1, 0)
    return hellinger_distance(first, second)

"""Tables of the references by second, computed before a rollout; and random choice of a reference.

Time comes first, so that a second is one slice, and the references last, so that picking one for every scenario is one
gather. The picked values have the scenario axis last, like the traffic that they are compared with.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Key

from rearl_jax.config.metrics import HistConfig
from rearl_jax.core.compaction import take_columns
from rearl_jax.core.neighbours import for_each_vehicle, row
from rearl_jax.detection.references import References
from rearl_jax.metrics.histograms import cumulative_speed_counts
from rearl_jax.metrics.measure import unrolled_sum

REFERENCE_STREAM = 2**31 - 1
"""Number of the random stream of drawn references, larger than the numbers of the seconds of a rollout, each of which
has a stream of its own.
"""


class ReferenceTable(eqx.Module):
    """The references, tabulated.

    Attributes:
        speed: Rescaled speed of each vehicle [m/s].
        spacing: Mean distance of each vehicle to the others [m].
        mean_spacing: Mean distance over all pairs [m].
        action: Action of each vehicle in the following second, a `MetaAction`.
        speed_rank: `relative_rank` of the speeds [-].
        spacing_rank: `relative_rank` of the spacings [-].
        window_counts: Speeds per bin in the window that ends with the second, shorter at the beginning.
        prefix_roots: Square roots of the shares of the bins in all speeds so far [-].
        share: Share of the scenes that each reference represents [-].
    """

    speed: Float[Array, "seconds slots refs"]
    spacing: Float[Array, "seconds slots refs"]
    mean_spacing: Float[Array, "seconds refs"]
    action: Int[Array, "seconds slots refs"]
    speed_rank: Float[Array, "seconds slots refs"]
    spacing_rank: Float[Array, "seconds slots refs"]
    window_counts: Int[Array, "seconds bins refs"]
    prefix_roots: Float[Array, "seconds bins refs"]
    share: Float[Array, " refs"]

    @property
    def n_seconds(self) -> int:
        """Length of the references [s]."""
        return self.speed.shape[0]

    @property
    def n_references(self) -> int:
        """Number of references."""
        return self.speed.shape[-1]


class Snapshot(eqx.Module):
    """One second of the reference of every scenario; fields as in `ReferenceTable`."""

    speed: Float[Array, "slots scenarios"]
    spacing: Float[Array, "slots scenarios"]
    mean_spacing: Float[Array, " scenarios"]
    action: Int[Array, "slots scenarios"]
    speed_rank: Float[Array, "slots scenarios"]
    spacing_rank: Float[Array, "slots scenarios"]


def relative_rank(values: Float[Array, "n *scenarios"]) -> Float[Array, "n *scenarios"]:
    """Rank of each value among all, within (0, 1): (number of smaller values + half the number of equal values) / n.

    Each value equals itself, so the ranks of n different values are 0.5 / n, 1.5 / n, ...
    """

    def count(other: Int[Array, ""], doubled_rank: Array) -> Array:
        value = row(values, other)
        return doubled_rank + (value < values).astype(jnp.int32) + (value <= values).astype(jnp.int32)

    doubled_rank = for_each_vehicle(values.shape[0], count, jnp.zeros(values.shape, jnp.int32))
    return doubled_rank.astype(values.dtype) / (2 * values.shape[0])


def root_shares(counts: Int[Array, "bins *n"], dtype: jnp.dtype) -> Float[Array, "bins *n"]:
    """Square roots of the shares of the bins [-]; their distance over sqrt(2) is the Hellinger distance."""
    total = unrolled_sum(counts, 0)[None]
    return jnp.sqrt(counts.astype(dtype) / jnp.maximum(total, 1).astype(dtype))


def tabulate(references: References, hist: HistConfig, dtype: jnp.dtype = jnp.float32) -> ReferenceTable:
    """Tables of the references for the detection and the policies.

    Args:
        references: Representative scenes.
        hist: Bins and window of the speed histogram.
        dtype: Floating type of the simulation.
    """
    speed, spacing = (
        jnp.moveaxis(jnp.asarray(values, dtype), 0, -1) for values in (references.speed, references.spacing)
    )
    cumulative = cumulative_speed_counts(speed, hist)
    starts = jnp.maximum(jnp.arange(1, speed.shape[0] + 1) - hist.window, 0)
    ranks = jax.vmap(relative_rank)
    return ReferenceTable(
        speed=speed,
        spacing=spacing,
        mean_spacing=jnp.moveaxis(jnp.asarray(references.mean_spacing, dtype), 0, -1),
        action=jnp.moveaxis(jnp.asarray(references.action, jnp.int32), 0, -1),
        speed_rank=ranks(speed),
        spacing_rank=ranks(spacing),
        window_counts=cumulative[1:] - cumulative[starts],
        prefix_roots=jax.vmap(partial(root_shares, dtype=speed.dtype))(cumulative[1:]),
        share=jnp.asarray(references.share, jnp.float32),
    )


def draw_references(share: Float[Array, " refs"], keys: Key[Array, " scenarios"]) -> Int[Array, " scenarios"]:
    """One reference for every scenario, each as probable as its share.

    Args:
        share: Share of each reference; only the ratios of the shares matter.
        keys: Random keys of the rollouts. The draw has a random stream of its own, independent of numbers derived
            from the same keys second by second.
    """
    # Always in float32, so that simulations in float32 and float64 are compared with the same references.
    bounds = jnp.cumsum(share.astype(jnp.float32))
    bounds = bounds / bounds[-1]
    reference_keys = jax.vmap(lambda key: jax.random.fold_in(key, REFERENCE_STREAM))(keys)
    drawn = jax.vmap(lambda key: jax.random.uniform(key, (), jnp.float32))(reference_keys)
    return (drawn[None] >= bounds[:, None]).sum(axis=0, dtype=jnp.int32)


def at_second(values: Array, second: Int[Array, ""]) -> Array:
    """One second of a tabulated quantity."""
    return jax.lax.dynamic_index_in_dim(values, second, 0, keepdims=False)


def of_reference(values: Array, reference: Int[Array, " scenarios"]) -> Array:
    """Values of each scenario's reference: from `[..., n_references]` to `[..., n_scenarios]`."""
    return take_columns(values, reference)


def snapshot(table: ReferenceTable, second: Int[Array, ""], reference: Int[Array, " scenarios"]) -> Snapshot:
    """The second of each scenario's reference that policies imitate."""

    def look_up(values: Array) -> Array:
        return of_reference(at_second(values, second), reference)

    return Snapshot(
        speed=look_up(table.speed),
        spacing=look_up(table.spacing),
        mean_spacing=look_up(table.mean_spacing),
        action=look_up(table.action),
        speed_rank=look_up(table.speed_rank),
        spacing_rank=look_up(table.spacing_rank),
    )

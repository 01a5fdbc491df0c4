"""Time headway, time to collision, deceleration to avoid a crash, and collisions."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.config.metrics import Gap, SafetyConfig, ThwConfig
from rearl_jax.metrics.following import Followers
from rearl_jax.metrics.measure import Measure, scene_count, scene_mean, scene_median, share_of


class Headways(eqx.Module):
    """Mean and median time headway [s] of the valid pairs, and the share of pairs that are not valid."""

    mean: Measure
    median: Measure
    excluded: Measure


class Conflicts(eqx.Module):
    """Least time to collision, and shares of critical leader-follower pairs, pooled over all frames.

    Attributes:
        ttc_min: Least time to collision [s].
        ttc_share: Share of the pairs with a short time to collision [-].
        drac_share: Share of the pairs in which the follower must brake hard to avoid a crash [-].
        critical_share: Share of the pairs with either [-].
    """

    ttc_min: Measure
    ttc_share: Measure
    drac_share: Measure
    critical_share: Measure


class Collisions(eqx.Module):
    """Share of vehicles that crashed, and 1 if any vehicle did."""

    share: Measure
    any: Measure


def pair_headways(
    followers: Followers,
    speed: Float[Array, "steps vehicles *scenarios"],
    crashed: Bool[Array, "steps vehicles *scenarios"],
    thw: ThwConfig,
) -> tuple[Float[Array, "steps vehicles *scenarios"], Bool[Array, "steps vehicles *scenarios"]]:
    """Time headways gap / v of same-lane leader-follower pairs [s], by follower, and whether each pair is valid.

    A pair is valid if the follower drives at least `thw.v_min`, neither vehicle has crashed and the gap is
    positive.

    Args:
        followers: Result of `find_leaders`.
        speed: Speed of the follower [m/s].
        crashed: Whether the follower has crashed.
        thw: Kind of gap, and lowest speed of a follower.

    Source: REARL (Bi et al.); the rule for valid pairs is this package's reading.
    """
    gap = followers.gap if thw.gap is Gap.bumper else followers.centre_distance
    moving = (speed >= thw.v_min) & ~crashed & ~followers.leader_crashed
    valid = followers.has_leader & moving & (gap > 0)
    return jnp.where(valid, gap, 0) / jnp.where(valid, speed, 1), valid


def time_headways(
    followers: Followers,
    speed: Float[Array, "steps vehicles *scenarios"],
    crashed: Bool[Array, "steps vehicles *scenarios"],
    thw: ThwConfig,
) -> Headways:
    """Time headways of same-lane leader-follower pairs, pooled over all frames; arguments as in `pair_headways`."""
    headway, valid = pair_headways(followers, speed, crashed, thw)
    return Headways(
        mean=scene_mean(headway, valid),
        median=scene_median(headway, valid),
        excluded=share_of(~valid, followers.has_leader, speed.dtype),
    )


def time_to_collision(followers: Followers, *, cap: float) -> Float[Array, "steps vehicles *scenarios"]:
    """Time to collision gap / dv of a follower that closes in on its leader [s], at most `cap`.

    Also `cap` if no collision is possible: no leader, not closing in, or the vehicles overlap already.

    Source: Hayward, Highway Research Record 384 (1972) 24; the cap as in the Waymo Sim Agents challenge.
    """
    closing = followers.has_leader & (followers.dv > 0) & (followers.gap > 0)
    ttc = jnp.where(closing, followers.gap, cap) / jnp.where(closing, followers.dv, 1)
    return jnp.minimum(ttc, cap)


def conflicts(
    followers: Followers, crashed: Bool[Array, "steps vehicles *scenarios"], safety: SafetyConfig
) -> Conflicts:
    """Surrogate safety measures of leader-follower pairs with a positive gap, neither crashed.

    TTC = gap / dv and DRAC = dv^2 / (2 gap) for dv > 0. A pair in a frame is a safety-critical event if
    TTC < `safety.ttc` or DRAC > `safety.drac`. Shares are over all such pairs, closing in or not; the least
    TTC is over those that close in.

    Args:
        followers: Result of `find_leaders`.
        crashed: Whether the follower has crashed.
        safety: Thresholds.

    Source: TTC: Hayward (1972), threshold FHWA-HRT-08-051 (2008); DRAC: Cooper & Ferguson, Traffic
    Engineering & Control 17 (1976) 306, threshold Archer (2005); share of time below a TTC: Minderhoud &
    Bovy, Accident Analysis & Prevention 33 (2001) 89.
    """
    gap, dv = followers.gap, followers.dv
    pair = followers.has_leader & ~crashed & ~followers.leader_crashed & (gap > 0)
    closing = pair & (dv > 0)
    safe_gap, safe_dv = jnp.where(closing, gap, 1), jnp.where(closing, dv, 1)
    ttc, drac = safe_gap / safe_dv, safe_dv**2 / (2 * safe_gap)
    is_short, is_hard = closing & (ttc < safety.ttc), closing & (drac > safety.drac)
    n_closing = scene_count(closing)
    least = jnp.min(jnp.where(closing, ttc, jnp.inf), axis=(0, 1))
    return Conflicts(
        ttc_min=Measure(jnp.where(n_closing > 0, least, 0), n_closing),
        ttc_share=share_of(is_short, pair, gap.dtype),
        drac_share=share_of(is_hard, pair, gap.dtype),
        critical_share=share_of(is_short | is_hard, pair, gap.dtype),
    )


def collisions(
    crashed: Bool[Array, "steps vehicles *scenarios"],
    n_crashed_replaced: Int[Array, "steps vehicles *scenarios"] | None,
    track_id: Int[Array, "steps vehicles *scenarios"] | None,
    dtype: jnp.dtype,
) -> Collisions:
    """Share of vehicles crashed when they were last simulated, and whether the scene has a crash at all.

    Args:
        crashed: Whether the vehicle has crashed.
        n_crashed_replaced: Crashed vehicles in the slot replaced by entering ones so far [count]; None if none enters.
        track_id: Id of the vehicle in each slot; needed with `n_crashed_replaced`.
        dtype: Floating-point type of the result.
    """
    n_crashed = jnp.sum(crashed[-1], axis=0, dtype=jnp.int32)
    n_vehicles = jnp.full_like(n_crashed, crashed.shape[1])
    if n_crashed_replaced is not None and track_id is not None:
        n_crashed += jnp.sum(n_crashed_replaced[-1], axis=0, dtype=jnp.int32)
        n_vehicles += jnp.sum(track_id[1:] != track_id[:-1], axis=(0, 1), dtype=jnp.int32)
    share = n_crashed.astype(dtype) / n_vehicles.astype(dtype)
    any_crash = ((scene_count(crashed) > 0) | (n_crashed > 0)).astype(dtype)
    return Collisions(Measure(share, n_vehicles), Measure(any_crash, jnp.ones_like(n_crashed)))

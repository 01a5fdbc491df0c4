"""Policies that decide inside the compiled program: the matcher, and simpler policies to compare it with."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Key

from rearl_jax.config.decision import MatcherConfig, MatchSpace, PolicyName
from rearl_jax.core.meta_actions import MetaAction
from rearl_jax.core.model import TrafficModel
from rearl_jax.decision.situation import Policy, Situation
from rearl_jax.detection.table import ReferenceTable, Snapshot, relative_rank, snapshot


def make_policy(name: PolicyName, matcher: MatcherConfig, model: TrafficModel) -> Policy:
    """The policy of that name; the matcher's options and the speed levels of the road are fixed in it."""
    levels = model.speed_levels
    match = partial(
        imitate,
        options=matcher,
        speed_range=levels[-1] - levels[0],
        level_step=(levels[-1] - levels[0]) / (len(levels) - 1),
    )
    return {
        PolicyName.matcher: partial(_nearest_reference, match=match),
        PolicyName.matcher_random_ref: partial(_random_reference, match=match),
        PolicyName.idle: idle,
        PolicyName.random_admissible: random_admissible,
    }[name]


def idle(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"]
) -> Int[Array, "vehicles scenarios"]:
    """IDLE, keep lane and speed, for every vehicle."""
    return jnp.full(situation.is_asked.shape, int(MetaAction.IDLE), jnp.int32)


def random_admissible(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"]
) -> Int[Array, "vehicles scenarios"]:
    """An admissible action for every vehicle, all equally likely."""
    shape = situation.admissible.shape[:-1]
    drawn = jax.vmap(lambda key: jax.random.uniform(key, shape, jnp.float32), out_axes=-1)(keys)
    return jnp.argmax(jnp.where(situation.admissible, drawn, -1.0), axis=0).astype(jnp.int32)


def _nearest_reference(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"], *, match: "partial[Array]"
) -> Int[Array, "vehicles scenarios"]:
    """Actions that imitate the reference that the detection compares with."""
    return match(situation, snapshot(table, situation.second, situation.detection.reference))


def _random_reference(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"], *, match: "partial[Array]"
) -> Int[Array, "vehicles scenarios"]:
    """Actions that imitate a reference that is drawn every second."""
    draw = partial(jax.random.randint, shape=(), minval=0, maxval=table.n_references, dtype=jnp.int32)
    return match(situation, snapshot(table, situation.second, jax.vmap(draw)(keys)))


def imitate(
    situation: Situation, reference: Snapshot, *, options: MatcherConfig, speed_range: float, level_step: float
) -> Int[Array, "vehicles scenarios"]:
    """Action of every vehicle that brings it nearer to the most similar vehicle of the reference.

    The most similar vehicle is the one with the least cost, the first of them on a tie. With v the speed and d the mean
    distance to the other vehicles, and v* and d* those of the reference's vehicle, the cost is

    - `space=raw`: |v - v*| / speed_range + |d - d*| / max(d*, 1 m);
    - `space=rank`: |rank(v) - rank(v*)| + |rank(d) - rank(d*)|, and `value_weight` times
      |v - v*| / speed_range + |d - d*| / max(mean d*, 1 m).

    Each vehicle decides alone, so several vehicles may imitate the same one. If the imitated vehicle changes lanes in
    the following second, the change is copied if it is admissible and at least `lane_change_pause` seconds have passed
    since the last change of the deciding vehicle. Otherwise the action is FASTER or SLOWER if the speeds differ by more
    than half a speed level, else IDLE; with `spacing_rule`, `spread_or_contract` replaces IDLE where the spacing error
    exceeds its threshold.

    Args:
        situation: The traffic.
        reference: Snapshot of the reference.
        options: Options of the matcher.
        speed_range: Difference of the highest and the lowest speed level [m/s].
        level_step: Difference of two neighbouring speed levels [m/s].

    Source: our deterministic stand-in for the language model of REARL (Bi et al.), which is instructed to find the most
    similar vehicle and to approach it.
    """
    speed, spacing = situation.frame.speed, situation.spacing
    is_rank = options.space is MatchSpace.rank
    divisor = jnp.broadcast_to(reference.mean_spacing[None], reference.spacing.shape) if is_rank else reference.spacing
    distance_weight = 1 / jnp.maximum(divisor, 1.0)
    speed_rank, spacing_rank = (relative_rank(speed), relative_rank(spacing)) if is_rank else (speed, spacing)

    least_cost = jnp.full_like(speed, jnp.inf)
    wanted_speed, wanted_action = jnp.zeros_like(speed), jnp.zeros(speed.shape, jnp.int32)
    for slot in range(reference.speed.shape[0]):
        slot_row = slice(slot, slot + 1)
        cost = jnp.abs(speed - reference.speed[slot_row]) / speed_range
        cost = cost + jnp.abs(spacing - reference.spacing[slot_row]) * distance_weight[slot_row]
        if is_rank:
            rank_cost = jnp.abs(speed_rank - reference.speed_rank[slot_row]) + jnp.abs(
                spacing_rank - reference.spacing_rank[slot_row]
            )
            cost = rank_cost + options.value_weight * cost
        is_nearer = cost < least_cost
        least_cost = jnp.where(is_nearer, cost, least_cost)
        wanted_speed = jnp.where(is_nearer, reference.speed[slot_row], wanted_speed)
        wanted_action = jnp.where(is_nearer, reference.action[slot_row], wanted_action)

    difference = wanted_speed - speed
    action = jnp.where(
        difference > level_step / 2,
        int(MetaAction.FASTER),
        jnp.where(difference < -level_step / 2, int(MetaAction.SLOWER), int(MetaAction.IDLE)),
    ).astype(jnp.int32)
    if options.spacing_rule:
        spacing_action = spread_or_contract(situation, reference.mean_spacing)
        replaces = (action == MetaAction.IDLE) & situation.detection.spacing_exceeded[None]
        action = jnp.where(replaces, spacing_action, action)
    if options.lane_changes:
        may_change_lanes = situation.since_lane_change >= options.lane_change_pause
        for side in (MetaAction.LANE_LEFT, MetaAction.LANE_RIGHT):
            copies = (wanted_action == side) & situation.admissible[side] & may_change_lanes
            action = jnp.where(copies, int(side), action)
    return action


def spread_or_contract(situation: Situation, spacing: Float[Array, " scenarios"]) -> Int[Array, "vehicles scenarios"]:
    """FASTER for the front half and SLOWER for the rear half if the mean spacing is below `spacing` [m]; the reverse if
    it is above.
    """
    is_front = relative_rank(situation.frame.x) > 0.5
    is_too_close = situation.detection.mean_spacing < spacing
    return jnp.where(is_front == is_too_close[None], int(MetaAction.FASTER), int(MetaAction.SLOWER)).astype(jnp.int32)

"""Policies that decide inside the compiled program: the matcher, and controls that show what its parts are worth."""

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
        level_step=(levels[-1] - levels[0]) / len(levels[1:]),
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
    """IDLE for everybody."""
    return jnp.full(situation.is_asked.shape, int(MetaAction.IDLE), jnp.int32)


def random_admissible(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"]
) -> Int[Array, "vehicles scenarios"]:
    """For every vehicle one of its admissible actions, all equally likely."""
    shape = situation.admissible.shape[:-1]
    drawn = jax.vmap(lambda key: jax.random.uniform(key, shape, jnp.float32), out_axes=-1)(keys)
    return jnp.argmax(jnp.where(situation.admissible, drawn, -1.0), axis=0).astype(jnp.int32)


def _nearest_reference(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"], *, match: "partial[Array]"
) -> Int[Array, "vehicles scenarios"]:
    """Actions that imitate the reference the detection has chosen."""
    return match(situation, snapshot(table, situation.second, situation.detection.reference))


def _random_reference(
    situation: Situation, table: ReferenceTable, keys: Key[Array, " scenarios"], *, match: "partial[Array]"
) -> Int[Array, "vehicles scenarios"]:
    """Actions that imitate a reference drawn anew every second."""
    draw = partial(jax.random.randint, shape=(), minval=0, maxval=table.n_references, dtype=jnp.int32)
    return match(situation, snapshot(table, situation.second, jax.vmap(draw)(keys)))


def imitate(
    situation: Situation, reference: Snapshot, *, options: MatcherConfig, speed_range: float, level_step: float
) -> Int[Array, "vehicles scenarios"]:
    """For every vehicle the action that brings it nearer to the vehicle of the reference that is most like it.

    Likeness is a small sum of differences: in rank space |rank(v) - rank(v*)| + |rank(d) - rank(d*)| and, weighted
    by `value_weight`, |v - v*| / speed_range + |d - d*| / max(mean d*, 1 m); in raw space |v - v*| / speed_range +
    |d - d*| / max(d*, 1 m). v speed, d mean distance to the others, * of the reference; of equally alike
    vehicles the first. Several vehicles may imitate the same one: each decides alone.

    The lane change of that vehicle in the following second is copied where it is admissible and the last one was not
    just now. Otherwise FASTER or SLOWER where its speed is more than half a level away, else IDLE.

    Args:
        situation: The traffic.
        reference: Snapshot of the reference.
        options: Space, weights, lane changes, spacing rule.
        speed_range: From the lowest to the highest speed level [m/s].
        level_step: Between two speed levels [m/s].

    Source: our deterministic stand-in for the language model of REARL (Bi et al.), which is asked to find the most
    similar vehicle and to approach it.
    """
    speed, spacing = situation.frame.speed, situation.spacing
    is_rank = options.space is MatchSpace.rank
    # Per slot of the reference: the divisor of its distance [m].
    scale = jnp.broadcast_to(reference.mean_spacing[None], reference.spacing.shape) if is_rank else reference.spacing
    scale = 1 / jnp.maximum(scale, 1.0)
    speed_rank, spacing_rank = (relative_rank(speed), relative_rank(spacing)) if is_rank else (speed, spacing)

    least = jnp.full_like(speed, jnp.inf)
    wanted_speed, wanted_action = jnp.zeros_like(speed), jnp.zeros(speed.shape, jnp.int32)
    for slot in range(reference.speed.shape[0]):
        place = slice(slot, slot + 1)
        cost = jnp.abs(speed - reference.speed[place]) / speed_range
        cost = cost + jnp.abs(spacing - reference.spacing[place]) * scale[place]
        if is_rank:
            order = jnp.abs(speed_rank - reference.speed_rank[place]) + jnp.abs(
                spacing_rank - reference.spacing_rank[place]
            )
            cost = order + options.value_weight * cost
        is_nearer = cost < least
        least = jnp.where(is_nearer, cost, least)
        wanted_speed = jnp.where(is_nearer, reference.speed[place], wanted_speed)
        wanted_action = jnp.where(is_nearer, reference.action[place], wanted_action)

    gain = wanted_speed - speed
    action = jnp.where(
        gain > level_step / 2,
        int(MetaAction.FASTER),
        jnp.where(gain < -level_step / 2, int(MetaAction.SLOWER), int(MetaAction.IDLE)),
    ).astype(jnp.int32)
    if options.spacing_rule:
        instead = spread_or_contract(situation, reference.mean_spacing)
        replaces = (action == MetaAction.IDLE) & situation.detection.spacing_exceeded[None]
        action = jnp.where(replaces, instead, action)
    if options.lane_changes:
        may_turn = situation.since_lane_change >= options.lane_change_pause
        for side in (MetaAction.LANE_LEFT, MetaAction.LANE_RIGHT):
            copies = (wanted_action == side) & situation.admissible[side] & may_turn
            action = jnp.where(copies, int(side), action)
    return action


def spread_or_contract(situation: Situation, wanted: Float[Array, " scenarios"]) -> Int[Array, "vehicles scenarios"]:
    """FASTER for the front half and SLOWER for the others where the mean spacing is below the wanted one [m], the
    reverse where it is above.
    """
    is_front = relative_rank(situation.frame.x) > 0.5
    spreads = situation.detection.mean_spacing < wanted
    return jnp.where(is_front == spreads[None], int(MetaAction.FASTER), int(MetaAction.SLOWER)).astype(jnp.int32)

"""Who is next on every lane, ahead and behind, in large traffic.

The order along the road is walked once from the head of the traffic to its tail, remembering the last vehicle met on
each lane: that is the leader on this lane for whoever comes next. Walking back gives the followers.

What is remembered of all lanes fits into one 32-bit number, or few: each lane has a field of it, which holds the index
of a vehicle and a flag that says whether there is one. So a step of the walk is one operation for all lanes, and whom a
vehicle finds on a lane of its choice is read off its own number without looking anything up.
"""

import dataclasses
import functools
import math
from dataclasses import replace
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int, UInt32

from rearl_jax.core.compaction import Block, gather, if_any, list_vehicles, process_in_blocks, scatter
from rearl_jax.core.order import NOBODY, flat_index, take_vehicles

Words = tuple[UInt32[Array, "..."], ...]
"""The fields of all lanes, as many to a number as have room."""

Lane = TypeVar("Lane", int, Array)


def lane_bit(lane: Lane) -> Lane:
    """The bit that stands for a lane; lane -1, left of the road, has one too, which no vehicle ever sets."""
    return 1 << (lane + 1)


@dataclasses.dataclass(frozen=True)
class Fields:
    """How the lanes' fields lie in 32-bit numbers.

    Attributes:
        n_vehicles: Vehicles of a scenario.
        n_lanes: Lanes of the road.
    """

    n_vehicles: int
    n_lanes: int

    @property
    def flag(self) -> int:
        """The highest bit of a field, set where there is a vehicle."""
        return 1 << (self.n_vehicles - 1).bit_length()

    @property
    def width(self) -> int:
        """Bits of a field."""
        return self.flag.bit_length()

    @property
    def lanes_by_word(self) -> tuple[range, ...]:
        """The lanes of each number."""
        n_each = 32 // self.width
        return tuple(range(first, min(first + n_each, self.n_lanes)) for first in range(0, self.n_lanes, n_each))

    def flags(self, lanes: range) -> UInt32[Array, ""]:
        """The flags of all fields of a number."""
        return jnp.uint32(sum(self.flag << (self.width * place) for place in range(len(lanes))))

    def found(self, field: UInt32[Array, "*n"]) -> Int[Array, "*n"]:
        """The vehicle in a field, NOBODY for none."""
        return jnp.where(field >= self.flag, field.astype(jnp.int32) - self.flag, NOBODY)

    def on(self, words: Words, lane: Int[Array, "*n"]) -> UInt32[Array, "*n"]:
        """The field of a lane of each vehicle's choice; empty for lanes that do not exist."""
        chosen = jnp.zeros(lane.shape, jnp.uint32)
        for word, lanes in zip(words, self.lanes_by_word, strict=True):
            is_here = (lane >= lanes.start) & (lane < lanes.stop)
            shift = jnp.where(is_here, lane - lanes.start, 0).astype(jnp.uint32) * self.width
            chosen = jnp.where(is_here, (word >> shift) & jnp.uint32((1 << self.width) - 1), chosen)
        return chosen

    def of(self, index: Int[Array, "*n"], on_lanes: Int[Array, "*n"]) -> tuple[UInt32[Array, "*n"], ...]:
        """Vehicles in the fields of the lanes they are on.

        Args:
            index: The vehicles.
            on_lanes: Their lanes as bits, see `lane_bit`.
        """
        field, nobody = index.astype(jnp.uint32) | jnp.uint32(self.flag), jnp.zeros(index.shape, jnp.uint32)
        words = []
        for lanes in self.lanes_by_word:
            word = nobody
            for place, lane in enumerate(lanes):
                word = word | jnp.where((on_lanes & lane_bit(lane)) != 0, field << (self.width * place), nobody)
            words.append(word)
        return tuple(words)

    def first_of(self, nearer: Words, farther: Words) -> Words:
        """Of each field the nearer vehicle where there is one, else the farther."""
        return tuple(
            near | (far & ~(((near & self.flags(lanes)) >> (self.width - 1)) * ((1 << self.width) - 1)))
            for near, far, lanes in zip(nearer, farther, self.lanes_by_word, strict=True)
        )


class NearestOnLanes(eqx.Module):
    """The nearest vehicle ahead and behind on every lane, as each vehicle sees it.

    Vehicles abreast, which have exactly the same x, count as ahead of each other and never as behind. In the order they
    stand by falling index, so the answers for all of them begin at the first: it may be the vehicle ahead itself, being
    the last in the list, and only those before it are behind.

    Attributes:
        ahead: Who is next ahead on each lane.
        behind: Who is next behind on each lane.
        later: Who comes next on each lane in the order, which is not the one ahead of vehicles abreast.
        scenario: Scenario of each vehicle.
        n_scenarios: Number of scenarios.
        fields: How the lanes' fields lie.
    """

    ahead: Words
    behind: Words
    later: Words
    scenario: Int[Array, "#vehicles *scenarios"]
    n_scenarios: int = eqx.field(static=True)
    fields: Fields = eqx.field(static=True)

    def ahead_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        """The vehicle next ahead on a lane of each vehicle's choice; NOBODY for none, and on lanes that do not exist.

        The same x counts as ahead; of equally near vehicles the last in the list is meant.
        """
        return self.fields.found(self.fields.on(self.ahead, lane))

    def behind_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        """The vehicle next behind on a lane of each vehicle's choice; of equally near ones the first in the list."""
        return self.fields.found(self.fields.on(self.behind, lane))

    def after(
        self, index: Int[Array, "vehicles *scenarios"], lane: Int[Array, "vehicles *scenarios"]
    ) -> Int[Array, "vehicles *scenarios"]:
        """The next on a lane later in the order than a given vehicle; NOBODY for none.

        Args:
            index: The vehicles; means nothing for NOBODY.
            lane: The lanes.
        """
        later = tuple(self.take(word, index) for word in self.later)
        return self.fields.found(self.fields.on(later, lane))

    def take(self, values: Array, index: Int[Array, "vehicles *scenarios"]) -> Array:
        """All vehicles' values at the given indices, each within the scenario of the vehicle that asks.

        Args:
            values: Of all vehicles of all scenarios.
            index: The vehicles; of NOBODY the values mean nothing.
        """
        place = jnp.maximum(index, 0) * self.n_scenarios + self.scenario
        return values.ravel().at[place].get(mode="promise_in_bounds")

    def seen_by(self, place: Int[Array, " block"]) -> "NearestOnLanes":
        """The same for some vehicles of whichever scenarios, who alone may then ask.

        Args:
            place: Where they are among all vehicles of all scenarios in a row.
        """
        ahead, behind = (_taken(words, place) for words in (self.ahead, self.behind))
        return replace(self, ahead=ahead, behind=behind, scenario=place % self.n_scenarios)


def walk_along_road(
    order: Int[Array, "vehicles *scenarios"],
    x: Float[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    n_lanes: int,
) -> NearestOnLanes:
    """Everybody's nearest vehicles on every lane.

    Args:
        order: Vehicle indices as `order.sort_along_road` leaves them.
        x: Positions [m].
        on_lanes: Lanes each vehicle is on, as bits.
        n_lanes: Lanes of the road.
    """
    fields, n_scenarios = Fields(order.shape[0], n_lanes), math.prod(order.shape[1:])
    step = _by_step(flat_index(order), filling=order.size)
    on = on_lanes.ravel().at[step].get(mode="fill", fill_value=0)
    own = fields.of(step // n_scenarios, on)
    later, earlier = (_by_vehicle(_met(own, fields, reverse), step, order.shape) for reverse in (True, False))
    ahead, behind = _look_abreast(order, x, on_lanes, later, earlier, fields)
    scenario = lax.iota(jnp.int32, n_scenarios).reshape(1, *order.shape[1:])
    return NearestOnLanes(ahead, behind, later, scenario, n_scenarios, fields)


def _met(own: Words, fields: Fields, reverse: bool) -> Words:
    """Who has been met last on each lane before coming to a place, walking along the order or, reversed, against it.

    Stretches of the order are walked side by side (`_by_step`). Whom a stretch has met last on each lane is then handed
    on to the stretches that come after it, and counts wherever nobody has been met on the own one yet.
    """

    def pass_by(met: Words, vehicle: Words) -> tuple[Words, Words]:
        return fields.first_of(vehicle, met), met

    nobody = jax.tree.map(lambda word: jnp.zeros_like(word[0]), own)
    last, met = lax.scan(pass_by, nobody, own, reverse=reverse)
    nobody = jax.tree.map(jnp.zeros_like, last)
    somebody = functools.reduce(jnp.bitwise_or, last) != 0
    before = if_any(somebody, lambda: _handed_on(last, fields, reverse), nobody)
    return fields.first_of(met, jax.tree.map(lambda word: word[None], before))


def _handed_on(last: Words, fields: Fields, reverse: bool) -> Words:
    """Who has been met last on each lane on all stretches before each, given who has on each.

    Every stretch knows of the one before it, then both of the two before them, and so on: twice as far each time.
    """
    n_stretches = last[0].shape[0]

    def moved_on(words: Words, by: int) -> Words:
        ends = (0, by) if reverse else (by, 0)
        kept = slice(by, None) if reverse else slice(0, n_stretches)
        return jax.tree.map(lambda word: jnp.pad(word, [ends] + [(0, 0)] * (word.ndim - 1))[kept], words)

    known, reach = moved_on(last, 1), 1
    while reach < n_stretches - 1:
        known, reach = fields.first_of(known, moved_on(known, reach)), 2 * reach
    return known


def _by_step(values: Int[Array, "vehicles *scenarios"], filling: int) -> Int[Array, "length stretches *scenarios"]:
    """A row of vehicles cut into stretches that can be walked side by side.

    A plain walk takes n steps of one place each. With stretches of about sqrt(n) / 2 places, step k comes to the k-th
    place of every stretch: few steps, with vector code over many places in each.

    Args:
        values: By place.
        filling: What the last stretch is filled up with.
    """
    n_vehicles, others = values.shape[0], values.shape[1:]
    length = math.isqrt(n_vehicles - 1) // 2 + 1
    n_stretches = -(-n_vehicles // length)
    missing = [(0, n_stretches * length - n_vehicles)] + [(0, 0)] * len(others)
    filled = jnp.pad(values, missing, constant_values=filling)
    return filled.reshape(n_stretches, length, *others).swapaxes(0, 1)


def _by_vehicle(words: Words, step: Int[Array, "length stretches *scenarios"], shape: tuple[int, ...]) -> Words:
    """What has been found by step, by vehicle."""
    nobody = jnp.zeros(math.prod(shape), jnp.uint32)
    place = step.ravel()
    return tuple(nobody.at[place].set(word.ravel(), mode="drop").reshape(shape) for word in words)


def _taken(words: Words, place: Int[Array, " block"]) -> Words:
    """What some vehicles of whichever scenarios have found, given where they are among all in a row."""
    return tuple(gather(word, place, word.shape) for word in words)


def _look_abreast(
    order: Int[Array, "vehicles *scenarios"],
    x: Float[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    later: Words,
    earlier: Words,
    fields: Fields,
) -> tuple[Words, Words]:
    """Who is ahead and behind: those later and earlier in the order, but for vehicles abreast, of which there are few.

    Arguments as of `walk_along_road`, and who comes later and earlier.
    """
    along, shape, n_scenarios = take_vehicles(x, order), order.shape, math.prod(order.shape[1:])
    is_level = jnp.pad(along[1:] == along[:-1], [(1, 0)] + [(0, 0)] * (along.ndim - 1))
    is_level_flat, vehicle = is_level.ravel(), flat_index(order).ravel()

    def step_back(place: Array) -> Array:
        return place - n_scenarios * is_level_flat[place].astype(jnp.int32)

    def look(block: Block, found: tuple[Words, Words]) -> tuple[Words, Words]:
        first_place = lax.while_loop(lambda place: jnp.any(is_level_flat[place]), step_back, block.index)
        oneself, first = vehicle[block.index], vehicle[first_place]

        ahead = fields.first_of(fields.of(first // n_scenarios, gather(on_lanes, first, shape)), _taken(later, first))
        ahead = _but_oneself(oneself // n_scenarios, ahead, _taken(later, oneself), fields)
        new = ahead, _taken(earlier, first)
        return jax.tree.map(lambda values, word: scatter(values, oneself, block.is_filled, word), new, found)

    return process_in_blocks(list_vehicles(is_level), order.size // 256 + 2, look, (later, earlier))


def _but_oneself(index: Int[Array, "vehicles *scenarios"], found: Words, later: Words, fields: Fields) -> Words:
    """Who has been found on each lane; for vehicles that have found themselves the next one later in the order."""
    chosen = []
    for word, after, lanes in zip(found, later, fields.lanes_by_word, strict=True):
        for place in range(len(lanes)):
            field = jnp.uint32(((1 << fields.width) - 1) << (fields.width * place))
            oneself = (index.astype(jnp.uint32) | fields.flag) << (fields.width * place)
            # A difference, as jaxlib 0.10.2 miscompiles the chain of (word & ~field) | (after & field) for AVX-512.
            word = jnp.where((word & field) == oneself, word + ((after & field) - oneself), word)
        chosen.append(word)
    return tuple(chosen)

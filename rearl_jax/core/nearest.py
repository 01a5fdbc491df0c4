"""Leaders and followers on every lane, in large traffic.

The order along the road is scanned once from the head of the traffic to its tail, carrying the last vehicle passed on
each lane, which is the leader of the next vehicle on that lane. A scan in the other direction gives the followers.

The carry of all lanes is packed into one or a few 32-bit words: each lane has a bit field with the index of a vehicle
and a flag for its presence. A step of the scan is then one operation for all lanes, and reading the neighbour on a lane
from the vehicle's word needs no look-up in memory.
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
from rearl_jax.core.order import NO_VEHICLE, flat_index, take_flat, take_vehicles

Words = tuple[UInt32[Array, "..."], ...]
"""Bit fields of all lanes, packed into as few words as possible."""

Lane = TypeVar("Lane", int, Array)


def lane_bit(lane: Lane) -> Lane:
    """The bit of a lane; lane -1, left of the road, also has a bit, which is never set."""
    return 1 << (lane + 1)


@dataclasses.dataclass(frozen=True)
class LaneFields:
    """Layout of the lanes' bit fields in 32-bit words.

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
        """The lanes of each word."""
        step = 32 // self.width
        return tuple(range(first, min(first + step, self.n_lanes)) for first in range(0, self.n_lanes, step))

    def flags(self, lanes: range) -> UInt32[Array, ""]:
        """The flags of all fields of a word."""
        return jnp.uint32(sum(self.flag << (self.width * position) for position in range(len(lanes))))

    def vehicle_in(self, field: UInt32[Array, "*n"]) -> Int[Array, "*n"]:
        """The vehicle in a field, NO_VEHICLE for none."""
        return jnp.where(field >= self.flag, field.astype(jnp.int32) - self.flag, NO_VEHICLE)

    def extract(self, words: Words, lane: Int[Array, "*n"]) -> UInt32[Array, "*n"]:
        """The field of a given lane for each vehicle; empty for lanes that do not exist."""
        chosen = jnp.zeros(lane.shape, jnp.uint32)
        for word, lanes in zip(words, self.lanes_by_word, strict=True):
            is_here = (lane >= lanes.start) & (lane < lanes.stop)
            shift = jnp.where(is_here, lane - lanes.start, 0).astype(jnp.uint32) * self.width
            chosen = jnp.where(is_here, (word >> shift) & jnp.uint32((1 << self.width) - 1), chosen)
        return chosen

    def insert(self, index: Int[Array, "*n"], on_lanes: Int[Array, "*n"]) -> tuple[UInt32[Array, "*n"], ...]:
        """Words with vehicles in the fields of the lanes that they are on.

        Args:
            index: The vehicles.
            on_lanes: Their lanes as bits, see `lane_bit`.
        """
        field, no_vehicle = index.astype(jnp.uint32) | jnp.uint32(self.flag), jnp.zeros(index.shape, jnp.uint32)
        words = []
        for lanes in self.lanes_by_word:
            word = no_vehicle
            for position, lane in enumerate(lanes):
                word = word | jnp.where((on_lanes & lane_bit(lane)) != 0, field << (self.width * position), no_vehicle)
            words.append(word)
        return tuple(words)

    def nearer_of(self, nearer: Words, farther: Words) -> Words:
        """Fields with the nearer vehicle if there is one, else with the farther."""
        return tuple(
            near | (far & ~(((near & self.flags(lanes)) >> (self.width - 1)) * ((1 << self.width) - 1)))
            for near, far, lanes in zip(nearer, farther, self.lanes_by_word, strict=True)
        )


class NearestOnLanes(eqx.Module):
    """The nearest vehicle ahead and behind on every lane, for each vehicle.

    Vehicles side by side, with exactly the same x, count as ahead of each other and never as behind. They are ordered
    by falling index, so the first of them in the order is the last of them in the list. From this vehicle the
    neighbours of all of them follow: it may itself be their vehicle ahead, and vehicles behind precede it in the order.

    Attributes:
        ahead: Nearest vehicle ahead on each lane.
        behind: Nearest vehicle behind on each lane.
        later: Next vehicle on each lane in the order; differs from `ahead` for vehicles side by side.
        scenario: Scenario of each vehicle.
        n_scenarios: Number of scenarios.
        fields: Layout of the lanes' bit fields.
    """

    ahead: Words
    behind: Words
    later: Words
    scenario: Int[Array, "#vehicles *scenarios"]
    n_scenarios: int = eqx.field(static=True)
    fields: LaneFields = eqx.field(static=True)

    def ahead_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        """The nearest vehicle ahead on a lane given for each vehicle; NO_VEHICLE if there is none and on absent lanes.

        The same x counts as ahead; of equally near vehicles the last in the list is chosen.
        """
        return self.fields.vehicle_in(self.fields.extract(self.ahead, lane))

    def behind_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        """The nearest vehicle behind on a lane given for each vehicle; of equally near ones the first in the list."""
        return self.fields.vehicle_in(self.fields.extract(self.behind, lane))

    def after(
        self, index: Int[Array, "vehicles *scenarios"], lane: Int[Array, "vehicles *scenarios"]
    ) -> Int[Array, "vehicles *scenarios"]:
        """The next vehicle on a lane after a given vehicle in the order; NO_VEHICLE for none.

        Args:
            index: The vehicles; results for NO_VEHICLE are undefined.
            lane: The lanes.
        """
        later = tuple(self.take(word, index) for word in self.later)
        return self.fields.vehicle_in(self.fields.extract(later, lane))

    def take(self, values: Array, index: Int[Array, "vehicles *scenarios"]) -> Array:
        """All vehicles' values at the given indices, each within the scenario of the vehicle that searches.

        Args:
            values: Values of all vehicles of all scenarios.
            index: The vehicles; values for NO_VEHICLE are undefined.
        """
        flat = jnp.maximum(index, 0) * self.n_scenarios + self.scenario
        return take_flat(values, flat)

    def of_block(self, index: Int[Array, " block"]) -> "NearestOnLanes":
        """The same for some vehicles of any scenarios, given by flat indices; only these vehicles can then search."""
        ahead, behind = (_gather_words(words, index) for words in (self.ahead, self.behind))
        return replace(self, ahead=ahead, behind=behind, scenario=index % self.n_scenarios)


def scan_along_road(
    order: Int[Array, "vehicles *scenarios"],
    x: Float[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    n_lanes: int,
) -> NearestOnLanes:
    """The nearest vehicles on every lane, of all vehicles.

    Args:
        order: Vehicle indices as `order.sort_along_road` leaves them.
        x: Positions [m].
        on_lanes: Lanes each vehicle is on, as bits.
        n_lanes: Lanes of the road.
    """
    fields, n_scenarios = LaneFields(order.shape[0], n_lanes), math.prod(order.shape[1:])
    vehicle = _to_stretches(flat_index(order), filling=order.size)
    own_lanes = on_lanes.ravel().at[vehicle].get(mode="fill", fill_value=0)
    own_fields = fields.insert(vehicle // n_scenarios, own_lanes)
    later, earlier = (
        _to_vehicles(_last_passed(own_fields, fields, reverse), vehicle, order.shape) for reverse in (True, False)
    )
    ahead, behind = _correct_abreast(order, x, on_lanes, later, earlier, fields)
    scenario = lax.iota(jnp.int32, n_scenarios).reshape(1, *order.shape[1:])
    return NearestOnLanes(ahead, behind, later, scenario, n_scenarios, fields)


def _last_passed(own_fields: Words, fields: LaneFields, reverse: bool) -> Words:
    """The last vehicle passed on each lane before every place, scanning along the order or, reversed, against it.

    Stretches of the order are scanned in parallel (`_to_stretches`). The last vehicle of a stretch on each lane is then
    carried into the stretches after it, and is used until a stretch has passed a vehicle of its own.
    """

    def pass_by(passed: Words, vehicle: Words) -> tuple[Words, Words]:
        return fields.nearer_of(vehicle, passed), passed

    no_vehicle = jax.tree.map(lambda word: jnp.zeros_like(word[0]), own_fields)
    last, passed = lax.scan(pass_by, no_vehicle, own_fields, reverse=reverse)
    no_vehicle = jax.tree.map(jnp.zeros_like, last)
    has_any = functools.reduce(jnp.bitwise_or, last) != 0
    carried = if_any(has_any, lambda: _carried_in(last, fields, reverse), no_vehicle)
    return fields.nearer_of(passed, jax.tree.map(lambda word: word[None], carried))


def _carried_in(last: Words, fields: LaneFields, reverse: bool) -> Words:
    """For each stretch, the last vehicle on each lane in all stretches scanned before: exclusive prefixes of `last`.

    By doubling: results include one earlier stretch, then two, four, and so on.

    Source: Hillis & Steele, Commun. ACM 29 (1986) 1170.
    """
    n_stretches = last[0].shape[0]

    def shifted(words: Words, by: int) -> Words:
        padding = (0, by) if reverse else (by, 0)
        kept = slice(by, None) if reverse else slice(0, n_stretches)
        return jax.tree.map(lambda word: jnp.pad(word, [padding] + [(0, 0)] * (word.ndim - 1))[kept], words)

    carried, n_included = shifted(last, 1), 1
    while n_included < n_stretches - 1:
        carried, n_included = fields.nearer_of(carried, shifted(carried, n_included)), 2 * n_included
    return carried


def _to_stretches(values: Int[Array, "vehicles *scenarios"], filling: int) -> Int[Array, "length stretches *scenarios"]:
    """Values by place, cut into stretches that can be scanned side by side.

    A plain scan takes n steps of one place each. With stretches of about sqrt(n) / 2 places, step k comes to the k-th
    place of every stretch: few steps, with vector code over many places in each.

    Args:
        values: By place.
        filling: Value of the places by which the last stretch is too short.
    """
    n_vehicles, scenario_axes = values.shape[0], values.shape[1:]
    length = math.isqrt(n_vehicles - 1) // 2 + 1
    n_stretches = -(-n_vehicles // length)
    missing = [(0, n_stretches * length - n_vehicles)] + [(0, 0)] * len(scenario_axes)
    filled = jnp.pad(values, missing, constant_values=filling)
    return filled.reshape(n_stretches, length, *scenario_axes).swapaxes(0, 1)


def _to_vehicles(words: Words, vehicle: Int[Array, "length stretches *scenarios"], shape: tuple[int, ...]) -> Words:
    """Words by step of the scan, put in the order of the vehicle axis; `vehicle` is the flat index at each step."""
    no_vehicle = jnp.zeros(math.prod(shape), jnp.uint32)
    flat = vehicle.ravel()
    return tuple(no_vehicle.at[flat].set(word.ravel(), mode="drop").reshape(shape) for word in words)


def _gather_words(words: Words, index: Int[Array, " block"]) -> Words:
    """Words of some vehicles, given by flat indices."""
    return tuple(gather(word, index, word.shape) for word in words)


def _correct_abreast(
    order: Int[Array, "vehicles *scenarios"],
    x: Float[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    later: Words,
    earlier: Words,
    fields: LaneFields,
) -> tuple[Words, Words]:
    """Vehicles ahead and behind: those later and earlier in the order, corrected for the few vehicles side by side.

    Arguments as in `scan_along_road`; `later` and `earlier` are the next vehicles in the order on each lane.
    """
    sorted_x, shape, n_scenarios = take_vehicles(x, order), order.shape, math.prod(order.shape[1:])
    is_abreast = jnp.pad(sorted_x[1:] == sorted_x[:-1], [(1, 0)] + [(0, 0)] * (sorted_x.ndim - 1))
    flat_abreast, vehicle = is_abreast.ravel(), flat_index(order).ravel()

    def step_back(place: Array) -> Array:
        return place - n_scenarios * flat_abreast[place].astype(jnp.int32)

    def correct(block: Block, neighbours: tuple[Words, Words]) -> tuple[Words, Words]:
        first_place = lax.while_loop(lambda place: jnp.any(flat_abreast[place]), step_back, block.index)
        vehicles, first_vehicles = vehicle[block.index], vehicle[first_place]

        first_fields = fields.insert(first_vehicles // n_scenarios, gather(on_lanes, first_vehicles, shape))
        ahead = fields.nearer_of(first_fields, _gather_words(later, first_vehicles))
        ahead = _without_self(vehicles // n_scenarios, ahead, _gather_words(later, vehicles), fields)
        corrected = ahead, _gather_words(earlier, first_vehicles)
        return jax.tree.map(lambda new, old: scatter(new, vehicles, block.is_filled, old), corrected, neighbours)

    return process_in_blocks(list_vehicles(is_abreast), order.size // 256 + 2, correct, (later, earlier))


def _without_self(index: Int[Array, "vehicles *scenarios"], ahead: Words, later: Words, fields: LaneFields) -> Words:
    """Vehicles ahead on each lane; in fields that hold the vehicle itself, the next one later in the order."""
    chosen = []
    for word, after, lanes in zip(ahead, later, fields.lanes_by_word, strict=True):
        for position in range(len(lanes)):
            field = jnp.uint32(((1 << fields.width) - 1) << (fields.width * position))
            own_field = (index.astype(jnp.uint32) | fields.flag) << (fields.width * position)
            # The field is replaced by adding a difference. The plain form, (word & ~field) | (after & field), chained
            # over four lanes or more, is miscompiled for CPUs with AVX-512 by jaxlib 0.10.2: in random words nearly all
            # results are wrong, and none with --xla_cpu_max_isa=AVX2 or --xla_backend_optimization_level=0.
            word = jnp.where((word & field) == own_field, word + ((after & field) - own_field), word)
        chosen.append(word)
    return tuple(chosen)

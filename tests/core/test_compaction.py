"""Vehicles compacted or listed, treated apart from all others, and written back."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import bits
from rearl_jax.core.compaction import (
    compact,
    gather,
    list_bits,
    list_vehicles,
    process_in_blocks,
    room_for,
    scatter,
    take_columns,
)

N_VEHICLES, N_SCENARIOS, ONE_IN = 100, 5, 16
PLACES = room_for(N_VEHICLES, ONE_IN)
COMPACT = jax.jit(compact, static_argnums=1)


def so_many(*numbers: int) -> jnp.ndarray:
    """Mask of vehicles with a given number of each scenario at random places."""
    rng = np.random.default_rng(0)
    return jnp.asarray(np.stack([rng.permutation(N_VEHICLES) < number for number in numbers], axis=1))


@pytest.mark.parametrize("numbers", [(3, 0, 1, 7, 2), (PLACES, 1, 0, PLACES, 5)])
def test_the_subset_and_only_the_subset_gets_new_values(numbers):
    is_chosen = so_many(*numbers)
    values = np.arange(N_VEHICLES * N_SCENARIOS, dtype=np.float32).reshape(N_VEHICLES, N_SCENARIOS)

    @jax.jit
    def negated(is_chosen, values):
        subset = compact(is_chosen, ONE_IN)
        return subset, subset.scatter(-subset.gather(values), values)

    subset, found = negated(is_chosen, values)
    assert bool(subset.suffices)
    assert subset.vehicle.shape == (PLACES, N_SCENARIOS)
    np.testing.assert_array_equal(np.asarray(subset.is_filled).sum(axis=0), numbers)
    np.testing.assert_array_equal(found, np.where(is_chosen, -values, values))


def test_a_subset_stands_in_the_order_of_the_list():
    subset = COMPACT(so_many(3, 0, 1, 7, 2), ONE_IN)
    assert (np.diff(np.asarray(subset.vehicle), axis=0)[np.asarray(subset.is_filled)[1:]] > 0).all()


def test_a_subset_says_where_places_do_not_suffice():
    subset = COMPACT(so_many(1, 0, PLACES + 1, 2, 2), ONE_IN)
    assert not bool(subset.suffices)


def test_one_scenario_needs_no_axis():
    is_chosen, numbers = np.asarray(so_many(4))[:, 0], np.arange(N_VEHICLES)

    @jax.jit
    def kept(is_chosen, numbers):
        subset = compact(is_chosen, ONE_IN)
        return subset.scatter(subset.gather(numbers), jnp.zeros(N_VEHICLES, int))

    np.testing.assert_array_equal(kept(is_chosen, numbers), np.where(is_chosen, numbers, 0))


def chosen(shape, share, seed=0):
    return np.random.default_rng(seed).uniform(size=shape) < share


@pytest.mark.parametrize("shape", [(10, 1200), (3, 5), (61, 19), (7,)])
@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_everybody_listed_is_treated_once(shape, share):
    is_listed = chosen(shape, share)
    assert share in (0.0, 1.0) or is_listed.any()

    def count(is_listed):
        def treat(block, times):
            return scatter(gather(times, block.index, shape) + 1, block.index, block.is_filled, times)

        return process_in_blocks(list_vehicles(is_listed), 4, treat, jnp.zeros(shape, jnp.int32))

    np.testing.assert_array_equal(jax.jit(count)(jnp.asarray(is_listed)), is_listed)


def test_a_block_begins_anywhere():
    is_listed = chosen((40, 30), 0.2)
    count = int(is_listed.sum())

    @jax.jit
    def blocks(is_listed):
        listed = list_vehicles(is_listed)
        everybody, some, end = (listed.block(*given) for given in ((0, count), (17, 10), (count - 3, 10)))
        return listed.count, everybody.index, some.index, end.is_filled

    n_listed, everybody, some, end = map(np.asarray, blocks(is_listed))
    assert n_listed == count
    np.testing.assert_array_equal(some, everybody[17:27])
    np.testing.assert_array_equal(end, [True] * 3 + [False] * 7)


def test_bits_of_numbers_are_listed_with_number_and_bit():
    words = jnp.asarray([0, 5, 0x80000001, 0], jnp.uint32)
    block = jax.tree.map(np.asarray, jax.jit(lambda words: list_bits(words).block(0, 5))(words))
    found = [(int(n), int(b)) for n, b, there in zip(block.word, block.bit, block.is_filled, strict=True) if there]
    assert sorted(found) == [(1, 0), (1, 2), (2, 0), (2, 31)]


def test_values_that_are_one_for_all_are_taken_as_such():
    place = jnp.asarray([0, 5, 7], jnp.int32)
    assert gather(jnp.full((1, 1), 3.0), place, (2, 4)).shape == (1,)
    np.testing.assert_array_equal(gather(jnp.arange(4)[None], place, (2, 4)), [0, 1, 3])
    np.testing.assert_array_equal(gather(jnp.arange(2)[:, None], place, (2, 4)), [0, 1, 1])


def test_position_of_the_nth_bit():
    rng = np.random.default_rng(0)
    words = rng.integers(1, 2**32, 400, dtype=np.uint32)
    counts = np.asarray(jax.jit(bits.count)(words))
    rank = rng.integers(0, counts)
    expected = [[b for b in range(32) if n >> b & 1][r] for n, r in zip(words.tolist(), rank, strict=True)]
    found = jax.jit(bits.position)(words, rank.astype(np.int32))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("shape", [(4,), (2, 4), (3, 2, 4)])
@pytest.mark.parametrize("of", [np.asarray, jnp.asarray])
def test_scenarios_are_taken_along_the_last_axis(shape, of):
    values = np.arange(np.prod(shape)).reshape(shape)
    taken = take_columns(of(values), jnp.asarray([2, 0, 2, 9, -1]))
    np.testing.assert_array_equal(taken, values[..., [2, 0, 2, 3, 0]])

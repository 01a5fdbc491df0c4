"""Vehicles listed and treated a lot at a time."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import bits
from rearl_jax.core.lots import in_lots, list_bits, list_vehicles, put, take


def chosen(shape, share, seed=0):
    return np.random.default_rng(seed).uniform(size=shape) < share


@pytest.mark.parametrize("shape", [(10, 1200), (3, 5), (61, 19), (7,)])
@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_everybody_listed_is_treated_once(shape, share):
    is_listed = chosen(shape, share)
    assert share in (0.0, 1.0) or is_listed.any()

    def count(is_listed):
        def treat(lot, times):
            return put(take(times, lot.place, shape) + 1, lot.place, lot.is_there, times)

        return in_lots(list_vehicles(is_listed), 4, treat, jnp.zeros(shape, jnp.int32))

    np.testing.assert_array_equal(jax.jit(count)(jnp.asarray(is_listed)), is_listed)


def test_a_lot_begins_anywhere():
    listed = list_vehicles(jnp.asarray(chosen((40, 30), 0.2)))
    everybody = listed.lot(0, int(listed.count))
    some = listed.lot(17, 10)
    np.testing.assert_array_equal(some.place, everybody.place[17:27])
    end = listed.lot(int(listed.count) - 3, 10)
    np.testing.assert_array_equal(end.is_there, [True] * 3 + [False] * 7)


def test_bits_of_numbers_are_listed_with_number_and_bit():
    numbers = jnp.asarray([0, 5, 0x80000001, 0], jnp.uint32)
    lot = list_bits(numbers).lot(0, 5)
    found = [(int(n), int(b)) for n, b, there in zip(lot.number, lot.bit, lot.is_there, strict=True) if there]
    assert sorted(found) == [(1, 0), (1, 2), (2, 0), (2, 31)]


def test_values_that_are_one_for_all_are_taken_as_such():
    place = jnp.asarray([0, 5, 7], jnp.int32)
    assert take(jnp.full((1, 1), 3.0), place, (2, 4)).shape == (1,)
    np.testing.assert_array_equal(take(jnp.arange(4)[None], place, (2, 4)), [0, 1, 3])
    np.testing.assert_array_equal(take(jnp.arange(2)[:, None], place, (2, 4)), [0, 1, 1])


def test_position_of_the_nth_bit():
    rng = np.random.default_rng(0)
    numbers = rng.integers(1, 2**32, 400, dtype=np.uint32)
    counts = np.asarray(bits.count(jnp.asarray(numbers)))
    rank = rng.integers(0, counts)
    expected = [[b for b in range(32) if n >> b & 1][r] for n, r in zip(numbers.tolist(), rank, strict=True)]
    found = bits.position(jnp.asarray(numbers), jnp.asarray(rank, jnp.int32))
    np.testing.assert_array_equal(found, expected)

"""Vehicles picked out of all, treated by themselves, and put back."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.few import places_for, single_out

N_VEHICLES, N_SCENARIOS, ONE_IN = 100, 5, 16
PLACES = places_for(N_VEHICLES, ONE_IN)


def chosen(*numbers: int) -> jnp.ndarray:
    """That many of each scenario, anywhere."""
    rng = np.random.default_rng(0)
    return jnp.asarray(np.stack([rng.permutation(N_VEHICLES) < number for number in numbers], axis=1))


@pytest.mark.parametrize("numbers", [(3, 0, 1, 7, 2), (PLACES, 1, 0, PLACES, 5)])
def test_those_who_are_picked_out_and_only_those_get_new_values(numbers):
    is_chosen = chosen(*numbers)
    values = jnp.arange(N_VEHICLES * N_SCENARIOS, dtype=jnp.float32).reshape(N_VEHICLES, N_SCENARIOS)
    few = jax.jit(single_out, static_argnums=1)(is_chosen, ONE_IN)
    assert bool(few.suffices)
    assert few.who.shape == (PLACES, N_SCENARIOS)
    np.testing.assert_array_equal(few.is_there.sum(axis=0), numbers)
    np.testing.assert_array_equal(few.put(-few.take(values), values), np.where(is_chosen, -values, values))


def test_they_stand_in_the_order_of_the_list():
    few = single_out(chosen(3, 0, 1, 7, 2), ONE_IN)
    assert (np.diff(np.asarray(few.who), axis=0)[np.asarray(few.is_there)[1:]] > 0).all()


def test_it_says_where_places_do_not_suffice():
    few = single_out(chosen(1, 0, PLACES + 1, 2, 2), ONE_IN)
    assert not bool(few.suffices)


def test_one_scenario_needs_no_axis():
    is_chosen = chosen(4)[:, 0]
    few = single_out(is_chosen, ONE_IN)
    np.testing.assert_array_equal(few.put(few.take(jnp.arange(N_VEHICLES)), jnp.zeros(N_VEHICLES, int)),
                                  np.where(is_chosen, np.arange(N_VEHICLES), 0))  # fmt: skip

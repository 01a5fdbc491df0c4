"""Contacts in large traffic: what the sorted road finds is what holding everybody against everybody finds."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import collisions, pile_ups
from rearl_jax.core.contacts import extent_of
from rearl_jax.core.order import pick
from rearl_jax.core.rectangles import Rectangle
from tests.core.simulation import MODEL

N_VEHICLES, N_SCENARIOS = 61, 19


def piled_up(seed, dtype):
    """Slow vehicles on 12 m of a road of four lanes: each is inside many others."""
    rng = np.random.default_rng(seed)
    shape = (N_VEHICLES, N_SCENARIOS)
    heading = rng.normal(0.0, 0.3, shape)
    return Rectangle(
        x=jnp.asarray(rng.uniform(0.0, 12.0, shape), dtype),
        y=jnp.asarray(4.0 * rng.integers(0, 4, shape) + rng.normal(0.0, 0.5, shape), dtype),
        cos=jnp.asarray(np.cos(heading), dtype),
        sin=jnp.asarray(np.sin(heading), dtype),
        speed=jnp.asarray(rng.uniform(0.0, 10.0, shape), dtype),
        half_length=jnp.full(shape, 2.5, dtype),
        half_width=jnp.full(shape, 1.0, dtype),
        collides=jnp.asarray(rng.uniform(size=shape) < 0.9),
    )


def ahead_by(n):
    """Places from the vehicle of the row to that of the column."""
    return np.arange(n)[None] - np.arange(n)[:, None]


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.thorough)])
def test_pile_ups_of_many_windows_lots_and_scenarios(dtype):
    vehicles = piled_up(0, dtype)
    x, y = np.asarray(vehicles.x), np.asarray(vehicles.y)
    order = np.argsort(x, axis=0)
    touching = np.triu(np.ones((N_VEHICLES, N_VEHICLES), bool), 1)[..., None]
    for values, reach in ((x, 4.0), (y, 1.5)):
        along = np.take_along_axis(values, order, axis=0)
        touching = touching & (np.abs(along[None] - along[:, None]) < reach)
    behind, ahead, _ = np.nonzero(touching)
    assert (ahead - behind > 2 * pile_ups.WINDOW).sum() > 20
    assert touching.sum() > 10 * (x.size // pile_ups.TESTED + 1)
    beyond = np.any(touching & (ahead_by(N_VEHICLES) > pile_ups.WINDOW)[..., None], axis=1)
    assert beyond.sum() > 3 * (x.size // pile_ups.FOLLOWED + 1)
    assert N_VEHICLES % pile_ups.TOGETHER

    nobody, nothing = jnp.zeros(x.shape, bool), jnp.zeros(x.shape, dtype)
    marks, extent = (nobody, nobody, nothing, nothing), extent_of(vehicles, MODEL)
    expected = jax.jit(collisions._collide_in_list, static_argnums=3)(extent, vehicles, marks, MODEL)
    program = jax.jit(pile_ups.collide_along_road, static_argnums=3)
    order = jnp.asarray(order, jnp.int32)
    found = program(order, jax.tree.map(lambda values: pick(values, order), vehicles), marks, MODEL)
    assert int(expected[0].sum()) > 100
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)

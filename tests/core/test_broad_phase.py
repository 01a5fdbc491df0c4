"""Broad phase in large traffic: sweep and prune finds what testing every pair finds."""

from dataclasses import replace
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import broad_phase, collisions, narrow_phase
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.drivers import Body
from rearl_jax.core.state import make_state
from tests.core.simulation import MODEL

N_VEHICLES, N_SCENARIOS = 61, 19


def piled_up(seed, dtype):
    """Slow vehicles on 12 m of a road of four lanes: each is inside many others; one in ten does not look."""
    rng = np.random.default_rng(seed)
    shape = (N_VEHICLES, N_SCENARIOS)
    x, y = rng.uniform(0.0, 12.0, shape), 4.0 * rng.integers(0, 4, shape) + rng.normal(0.0, 0.5, shape)
    heading, speed = rng.normal(0.0, 0.3, shape), rng.uniform(0.0, 10.0, shape)
    state = make_state(x, y, speed, MODEL, heading=heading, dtype=dtype)
    order = jnp.asarray(np.argsort(np.asarray(state.x), axis=0), jnp.int32)
    length, width, limit = (jnp.full((1, 1), size, dtype) for size in (5.0, 2.0, 6.0))
    return replace(state, order=order), Body(length, width, limit, jnp.asarray(rng.uniform(size=shape) < 0.9))


def ahead_by(n):
    """Places from the vehicle of the row to that of the column."""
    return np.arange(n)[None] - np.arange(n)[:, None]


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.thorough)])
def test_queues_of_many_windows_blocks_and_scenarios(dtype):
    state, body = piled_up(0, dtype)
    x, y = np.asarray(state.x), np.asarray(state.y)
    touching = np.triu(np.ones((N_VEHICLES, N_VEHICLES), bool), 1)[..., None]
    for values, reach in ((x, 4.0), (y, 1.5)):
        along = np.take_along_axis(values, np.asarray(state.order), axis=0)
        touching = touching & (np.abs(along[None] - along[:, None]) < reach)
    behind, ahead, _ = np.nonzero(touching)
    assert (ahead - behind > 2 * broad_phase.WINDOW).sum() > 20
    assert touching.sum() > 10 * (x.size // narrow_phase.VEHICLES_PER_CHECKED + 1)
    beyond = np.any(touching & (ahead_by(N_VEHICLES) > broad_phase.WINDOW)[..., None], axis=1)
    assert beyond.sum() > 3 * (x.size // broad_phase.VEHICLES_PER_SWEPT + 1)

    def collided(state):
        return collisions.collide(state, body, MODEL)

    found = jax.jit(collided, compiler_options=QUICKLY_COMPILED)(state)
    with mock.patch.object(collisions, "is_large", return_value=False):
        expected = jax.jit(lambda state: collided(state), compiler_options=QUICKLY_COMPILED)(state)
    assert int(expected.crashed.sum()) > 100
    for name in ("crashed", "is_pushed", "push_x", "push_y"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_boxes_hold_the_vehicles():
    """The cheap test passes whatever the full test finds, at any heading."""
    rng = np.random.default_rng(1)
    shape = (2, 10_000)
    x, y = rng.uniform(0.0, 7.0, shape), rng.uniform(0.0, 6.0, shape)
    heading, speed = rng.uniform(-4.0, 4.0, shape), rng.uniform(-30.0, 30.0, shape)
    state = make_state(x, y, speed, MODEL, heading=heading, dtype=np.float32)
    body = Body(*(jnp.full((1, 1), size, np.float32) for size in (5.0, 2.0, 6.0)), jnp.ones((1, 1), bool))

    def is_pushed():
        push = jax.jit(lambda state: collisions.collide(state, body, MODEL), compiler_options=QUICKLY_COMPILED)
        return np.asarray(push(state).is_pushed)

    by_boxes = is_pushed()
    with mock.patch.object(collisions, "candidates_in_list", lambda boxes: jnp.ones(boxes.x.shape, jnp.uint32)):
        np.testing.assert_array_equal(by_boxes, is_pushed())
    assert collisions.bounding_boxes(state, body, MODEL).x.shape == shape
    assert 2000 < by_boxes[0].sum() < 9000

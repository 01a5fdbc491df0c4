"""Boundaries for the tests: some vehicles of a simulation replayed as if they had been recorded."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from rearl_jax.core.boundary import Boundary, Entrants, Identity, Motion
from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.core.state import nearest_lane
from rearl_jax.core.step import step


def entrants(n_seconds, n_vehicles, n_scenarios, **changed):
    """Nobody, unless arrays say otherwise."""
    shape = (n_seconds, n_vehicles, n_scenarios)
    values = {name: np.zeros(shape) for name in ("x", "speed", "highest_speed", "wait")}
    values |= {"is_new": np.zeros(shape, bool), "lane": np.zeros(shape, np.int32)} | changed
    return Entrants(**jax.tree.map(jnp.asarray, values))


def nobody(n_seconds, n_vehicles, n_scenarios, steps=15, n_places=2, **changed):
    """A boundary without replayed vehicles."""
    places = (n_seconds, n_places, n_scenarios)
    still = jnp.zeros((n_seconds, steps, n_places, n_scenarios))
    motion = Motion(still, still, still, jnp.full(still.shape, NOT_RECORDED, jnp.int32))
    identity = Identity(jnp.ones(places), jnp.zeros(places), jnp.full(places, n_vehicles, jnp.int32))
    scene = jnp.arange(n_scenarios, dtype=jnp.int32)
    return Boundary(motion, identity, entrants(n_seconds, n_vehicles, n_scenarios, **changed), scene)


def states_of(state, drivers, model, n_seconds):
    """The state before the first step and after each but the last, `[n_seconds, steps, vehicles, scenarios]`."""

    def advance(before, _):
        return step(before, drivers, model), before

    per_second = model.ticks_per_second
    states = jax.jit(lambda state: lax.scan(advance, state, length=n_seconds * per_second)[1])(state)
    return jax.tree.map(lambda leaf: leaf.reshape(n_seconds, per_second, *leaf.shape[1:]), states)


def replay_of(states, which, model, length):
    """A boundary in which some vehicles of a simulation are replayed, around the others."""
    n_seconds, _, n_vehicles, n_scenarios = states.x.shape
    x, y, speed, acceleration = (getattr(states, name)[:, :, which] for name in ("x", "y", "speed", "acceleration"))
    places = (n_seconds, x.shape[2], n_scenarios)
    number = jnp.broadcast_to(n_vehicles + jnp.arange(x.shape[2], dtype=jnp.int32)[:, None], places)
    identity = Identity(jnp.full(places, length), jnp.zeros(places), number)
    scene = jnp.arange(n_scenarios, dtype=jnp.int32)
    around = entrants(n_seconds, n_vehicles - x.shape[2], n_scenarios)
    return Boundary(Motion(x, speed, acceleration, nearest_lane(y, model)), identity, around, scene)

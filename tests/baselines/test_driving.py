"""Decisions: the mask, drawn and likeliest actions, and rollouts in which everybody follows them."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.baselines.driving import DrivingOptions, rollout_with_actor
from rearl_jax.baselines.experience import collect
from rearl_jax.baselines.network import drawn_actions, greedy_actions, log_probabilities, make_network
from rearl_jax.config.decision import Longitudinal
from rearl_jax.core import rollout as core
from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.state import Controller, make_state


def test_no_inadmissible_action_is_ever_taken():
    rng = np.random.default_rng(0)
    n = 4000
    logits = jnp.asarray(rng.normal(0, 100, (5, n)), jnp.float32)
    admissible = rng.random((5, n)) < 0.4
    best_is_out = ~admissible[np.asarray(logits).argmax(axis=0), np.arange(n)]
    nothing = ~admissible.any(axis=0)
    assert best_is_out.sum() > 1000
    assert nothing.sum() > 100
    for taken in (
        greedy_actions(logits, jnp.asarray(admissible)),
        drawn_actions(jax.random.key(0), logits, jnp.asarray(admissible)),
        drawn_actions(jax.random.key(1), 0 * logits, jnp.asarray(admissible)),
    ):
        taken = np.asarray(taken)
        assert (taken[nothing] == -1).all()
        assert admissible[taken[~nothing], np.flatnonzero(~nothing)].all()
    shares = np.exp(np.asarray(log_probabilities(logits, jnp.asarray(admissible))))
    assert (shares[:, ~nothing][~admissible[:, ~nothing]] == 0).all()
    np.testing.assert_allclose(shares.sum(axis=0), 1, atol=1e-5)


def test_actions_are_drawn_with_their_probability():
    n = 20_000
    logits = jnp.broadcast_to(jnp.asarray([0.0, 1.0, 5.0, -1.0, 0.5], jnp.float32)[:, None], (5, n))
    admissible = jnp.ones((5, n), bool).at[2].set(False)
    drawn = np.asarray(drawn_actions(jax.random.key(3), logits, admissible))
    found = np.bincount(drawn, minlength=5) / n
    np.testing.assert_allclose(found, np.exp(np.asarray(log_probabilities(logits, admissible))[:, 0]), atol=0.01)


def test_the_network_is_layer_after_layer(network):
    features = np.random.default_rng(0).normal(size=(25, 3, 4)).astype(np.float32)
    for part, n_out in ((network.actor, 5), (network.critic, 1)):
        found = np.asarray(part(jnp.asarray(features)))
        assert found.shape == (n_out, 3, 4)
        hidden = features[:, 1, 2]
        for layer in part.layers[:-1]:
            hidden = np.tanh(np.asarray(layer.weight) @ hidden + np.asarray(layer.bias))
        expected = np.asarray(part.layers[-1].weight) @ hidden + np.asarray(part.layers[-1].bias)
        np.testing.assert_allclose(found[:, 1, 2], expected, rtol=1e-4, atol=1e-5)


def rollout(start, network, model, n_seconds=8, **options):
    run = jax.jit(
        lambda state, drivers, actor: rollout_with_actor(
            state, drivers, actor, model, DrivingOptions(**options), n_seconds=n_seconds
        )
    )
    return run(*start, network.actor)


def test_a_rollout_is_what_its_actions_do(start, network, model):
    """Replayed by the core alone, with the actions that were recorded."""
    frames, actions = rollout(start, network, model)
    assert set(np.unique(actions)) >= {0, 2, 3, 4}
    state, drivers = start
    meta = eqx.tree_at(lambda s: s.controller, state, jnp.full_like(state.controller, int(Controller.META)))
    replayed = core.rollout(meta, drivers, model, n_seconds=8, actions=actions)[1]
    for name in ("x", "y", "speed"):
        np.testing.assert_allclose(getattr(frames, name), getattr(replayed, name), rtol=1e-6, atol=1e-4)
    np.testing.assert_array_equal(frames.lane, replayed.lane)


@pytest.mark.slow
def test_every_recorded_action_was_admissible(start, network, model):
    state, drivers = start
    run = jax.jit(lambda key: collect(state, drivers, network, key, model, DrivingOptions(), n_seconds=8))
    seen = run(jax.random.key(2))
    action, admissible = np.asarray(seen.action), np.asarray(seen.inputs.admissible)
    taken = np.take_along_axis(admissible, np.maximum(action, 0)[:, None], axis=1)[:, 0]
    assert taken.all()
    assert (~admissible).sum() > 500
    assert np.asarray(seen.decides).all()  # nobody crashes here
    assert np.isfinite(np.asarray(seen.log_probability)).all()
    assert (np.asarray(seen.log_probability) <= 0).all()


def test_crashed_vehicles_decide_nothing(start, network, model):
    state, drivers = start
    crashed = jnp.zeros_like(state.crashed).at[3, 5].set(True)
    state = eqx.tree_at(lambda s: s.crashed, state, crashed)
    frames, actions = rollout((state, drivers), network, replace(model, collisions=False), n_seconds=3)
    assert (np.asarray(actions)[:, 3, 5] == -1).all()
    assert (np.asarray(actions) == -1).sum() == 3
    assert (np.asarray(frames.crashed)[:, 3, 5]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mdp", "idm_capped"])
def test_how_target_speeds_are_followed(name, model):
    """Told to keep 30 m/s behind a vehicle at 10 m/s: blind it drives through, capped it brakes."""
    network = make_network(jax.random.key(0), width=4, layers=1)
    keep = jnp.asarray([0, 9, 0, 0, 0], jnp.float32)
    network = eqx.tree_at(lambda n: n.actor.layers[-1].bias, network, keep)
    x, y, speed = np.array([[0.0], [60.0]]), np.full((2, 1), 4.0), np.array([[30.0], [10.0]])
    start = make_state(x, y, speed, model), highway_env_drivers(jnp.full((2, 1), 4.0, jnp.float32))
    frames, actions = rollout(start, network, model, 5, longitudinal=Longitudinal[name])
    assert (np.asarray(actions) == 1).all()
    rear, front = np.asarray(frames.x)[:, :, 0].T
    assert ((rear > front).any()) == (name == "mdp")

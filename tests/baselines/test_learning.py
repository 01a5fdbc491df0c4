"""Advantages against a loop, the loss on hand values, and that learning lowers it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.baselines.experience import advantages, value_of_action
from rearl_jax.baselines.learning import Decisions, Learner, improve, loss, make_optimiser, split
from rearl_jax.baselines.network import drawn_actions, log_probabilities, make_network
from rearl_jax.config.ppo import PpoConfig


def plain_advantages(reward, value, last_value, ends, gamma, decay):
    found = np.zeros_like(reward)
    for column in np.ndindex(reward.shape[1:]):
        later = 0.0
        for t in reversed(range(len(reward))):
            at = (t, *column)
            following = last_value[column] if t == len(reward) - 1 else value[(t + 1, *column)]
            if ends[at]:
                following = later = 0.0
            later = reward[at] + gamma * following - value[at] + gamma * decay * later
            found[at] = later
    return found


def test_advantages_against_a_loop():
    rng = np.random.default_rng(0)
    shape = (12, 3, 4)
    reward, value, last = rng.random(shape), rng.normal(size=shape), rng.normal(size=shape[1:])
    ends = rng.random(shape) < 0.15
    assert ends.any()
    assert not ends[-1].all()
    found = advantages(*map(jnp.asarray, (reward, value, last, ends)), gamma=0.8, decay=0.95)
    np.testing.assert_allclose(found, plain_advantages(reward, value, last, ends, 0.8, 0.95), atol=1e-12)


@pytest.fixture
def toy():
    """Decisions of an untrained network where FASTER pays and everything else does not; some do not count."""

    @jax.jit
    def draw():
        n = 512
        network = make_network(jax.random.key(0), width=16, layers=2)
        observation = jax.random.normal(jax.random.key(1), (25, n), jnp.float32)
        admissible = jax.random.uniform(jax.random.key(2), (5, n)) < 0.8
        admissible = admissible.at[1].set(True)
        logits = network.actor(observation)
        action = drawn_actions(jax.random.key(3), logits, admissible)
        gain = (action == 3).astype(jnp.float32)
        return network, Decisions(
            observation=observation,
            admissible=admissible,
            action=action,
            log_probability=value_of_action(log_probabilities(logits, admissible), action),
            advantage=gain - 0.2,
            target=gain,
            weight=(jnp.arange(n) % 4 > 0).astype(jnp.float32),
        )

    return draw()


@pytest.fixture
def ppo():
    return PpoConfig(epochs=4, minibatch=128, learning_rate=3e-3)


def test_loss_on_hand_values(ppo):
    # A fresh network whose last layers are zero: all logits 0, value 0.
    shapes = jax.eval_shape(lambda: make_network(jax.random.key(0), width=4, layers=1))
    network = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    admissible = jnp.asarray([[True] * 4, [True] * 4, [False] * 4, [False] * 4, [False] * 4])  # two actions: 1/2 each
    ratio = np.array([1.0, 2.0, 0.5, 1.0])
    advantage = np.array([-1.0, 1.0, 0.0, 100.0])
    decisions = Decisions(
        observation=jnp.zeros((25, 4), jnp.float32),
        admissible=admissible,
        action=jnp.asarray([0, 1, 0, 1], jnp.int32),
        log_probability=jnp.asarray(np.log(0.5 / ratio), jnp.float32),
        advantage=jnp.asarray(advantage, jnp.float32),
        target=jnp.asarray([1.0, 2.0, 3.0, 50.0], jnp.float32),
        weight=jnp.asarray([1.0, 1.0, 1.0, 0.0], jnp.float32),  # the last does not count
    )
    total, parts = jax.jit(loss, static_argnums=2)(network, decisions, ppo)
    spread = np.sqrt(2 / 3)
    policy = -np.mean([-1.0 / spread, 1.2 / spread, 0.0])
    assert float(parts.policy) == pytest.approx(policy, rel=1e-5)
    assert float(parts.value) == pytest.approx(14 / 3, rel=1e-5)
    assert float(parts.entropy) == pytest.approx(np.log(2), rel=1e-5)
    assert float(parts.clipped_share) == pytest.approx(2 / 3)
    assert float(parts.divergence) == pytest.approx(np.mean(ratio[:3] - 1 - np.log(ratio[:3])), rel=1e-5)
    assert float(total) == pytest.approx(policy + 0.5 * 14 / 3 - 0.01 * np.log(2), rel=1e-5)


@pytest.mark.usefixtures("lenient")
def test_two_updates_lower_the_loss_and_make_what_pays_likelier(toy, ppo):
    network, decisions = toy
    optimiser = make_optimiser(ppo, 2, 512)
    learner = Learner(network, optimiser.init(network))
    step = jax.jit(lambda learner, key: improve(learner, decisions, key, ppo, optimiser))
    measure = jax.jit(loss, static_argnums=2)
    before = measure(network, decisions, ppo)[1]
    for number in range(2):
        learner, losses = step(learner, jax.random.key(number))
        assert losses.total.shape == (16,)
        after = measure(learner.network, decisions, ppo)[1]
        assert float(after.total) < float(before.total)
        assert float(after.value) < float(before.value)
        before = after
    may = np.asarray(decisions.admissible[3])
    share = [
        np.exp(log_probabilities(n.actor(decisions.observation), decisions.admissible))[3]
        for n in (network, learner.network)
    ]
    assert share[1][may].mean() > 1.1 * share[0][may].mean()  # the clip stops it at 1.2 times
    assert (share[1][~may] == 0).all()


def test_what_does_not_count_has_no_gradient(toy, ppo):
    network, decisions = toy
    poisoned = replace(
        decisions,
        advantage=jnp.where(decisions.weight > 0, decisions.advantage, 1e6),
        target=jnp.where(decisions.weight > 0, decisions.target, 1e6),
    )
    gradient = jax.jit(jax.grad(loss, has_aux=True), static_argnums=2)
    clean, other = (gradient(network, some, ppo)[0] for some in (decisions, poisoned))
    for a, b in zip(jax.tree.leaves(clean), jax.tree.leaves(other), strict=True):
        assert np.abs(a).max() > 0
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-7)


@pytest.mark.usefixtures("lenient")
def test_the_step_size_falls_to_zero(toy, ppo):
    network, decisions = toy
    optimiser = make_optimiser(ppo, 1, 512)
    step = jax.jit(lambda learner, key: improve(learner, decisions, key, ppo, optimiser)[0])
    once = step(Learner(network, optimiser.init(network)), jax.random.key(0))
    twice = step(once, jax.random.key(1))  # one more than it was made for
    moved = [np.abs(a - b).max() for a, b in zip(*map(jax.tree.leaves, (network, once.network)), strict=True)]
    stays = [np.abs(a - b).max() for a, b in zip(*map(jax.tree.leaves, (once.network, twice.network)), strict=True)]
    assert min(moved) > 0
    assert max(stays) == 0


@pytest.mark.parametrize(
    ("n", "largest", "expected"), [(38_400, 4096, (10, 3840)), (96, 100, (1, 96)), (10, 4, (3, 3))]
)
def test_minibatches(n, largest, expected):
    assert split(n, largest) == expected

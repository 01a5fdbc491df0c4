"""The policy as a network: observation -> how likely each admissible action is, and what the state is worth."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from rearl_jax._typing import PRNGKey
from rearl_jax.baselines.observation import N_FEATURES
from rearl_jax.decision.situation import N_ACTIONS, NO_ACTION

IMPOSSIBLE = -1e9
"""Logit of an action that is not admissible: its probability is 0 in float32, and no difference is infinite."""


class Perceptron(eqx.Module):
    """Layers with tanh between them; the axes of the batch come last, as in the simulation."""

    layers: tuple[eqx.nn.Linear, ...]

    def __call__(self, features: Float[Array, "features *batch"]) -> Float[Array, "outputs *batch"]:
        """Outputs of the last layer."""
        for number, layer in enumerate(self.layers):
            assert layer.bias is not None  # built with one
            bias = layer.bias.reshape(-1, *(1,) * (features.ndim - 1))
            features = jnp.tensordot(layer.weight, jnp.tanh(features) if number else features, 1) + bias
        return features


class ActorCritic(eqx.Module):
    """Two networks that share nothing: one decides, the other says what to expect.

    Attributes:
        actor: From an observation to a logit per action, in the order of `MetaAction`.
        critic: From an observation to the discounted sum of rewards expected from there on.
    """

    actor: Perceptron
    critic: Perceptron


def make_network(key: PRNGKey, *, width: int, layers: int) -> ActorCritic:
    """A network with random weights, float32.

    Orthogonal matrices, times sqrt(2) in the hidden layers, 0.01 for the logits and 1 for the value; biases zero.

    Source: purejaxrl/ppo.py; Andrychowicz et al., What Matters In On-Policy Reinforcement Learning? (2021).
    """
    actor_key, critic_key = jax.random.split(key)
    hidden = (N_FEATURES, *(width,) * layers)
    return ActorCritic(
        _perceptron(actor_key, (*hidden, N_ACTIONS), last_scale=0.01),
        _perceptron(critic_key, (*hidden, 1), last_scale=1.0),
    )


def _perceptron(key: PRNGKey, sizes: tuple[int, ...], *, last_scale: float) -> Perceptron:
    layers = []
    for number, (size_in, size_out) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
        is_last = number == len(sizes) - 2
        scale = last_scale if is_last else float(np.sqrt(2))
        orthogonal = jax.nn.initializers.orthogonal(scale, dtype=jnp.float32)
        own_key = jax.random.fold_in(key, number)
        empty = eqx.nn.Linear(size_in, size_out, dtype=jnp.float32, key=own_key)
        values = (orthogonal(own_key, (size_out, size_in)), jnp.zeros(size_out, jnp.float32))
        layers.append(eqx.tree_at(lambda layer: (layer.weight, layer.bias), empty, values))
    return Perceptron(tuple(layers))


def log_shares(
    logits: Float[Array, "actions *batch"], admissible: Bool[Array, "actions *batch"]
) -> Float[Array, "actions *batch"]:
    """Logarithm of the probability of each action, which is 0 for those that are not admissible."""
    return jax.nn.log_softmax(jnp.where(admissible, logits, IMPOSSIBLE), axis=0)


def greedy_actions(
    logits: Float[Array, "actions *batch"], admissible: Bool[Array, "actions *batch"]
) -> Int[Array, "*batch"]:
    """The likeliest admissible action; NO_ACTION where there is none."""
    return _where_any(jnp.argmax(jnp.where(admissible, logits, -jnp.inf), axis=0), admissible)


def drawn_actions(
    key: PRNGKey, logits: Float[Array, "actions *batch"], admissible: Bool[Array, "actions *batch"]
) -> Int[Array, "*batch"]:
    """An admissible action with its probability; NO_ACTION where there is none."""
    drawn = jax.random.categorical(key, jnp.where(admissible, logits, -jnp.inf), axis=0)
    return _where_any(drawn, admissible)


def _where_any(actions: Int[Array, "*batch"], admissible: Bool[Array, "actions *batch"]) -> Int[Array, "*batch"]:
    return jnp.where(jnp.any(admissible, axis=0), actions.astype(jnp.int32), NO_ACTION)

"""The policy as a network: probabilities of the admissible actions and value of the state, from an observation."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from rearl_jax._typing import PRNGKey
from rearl_jax.baselines.observation import N_FEATURES
from rearl_jax.decision.situation import N_ACTIONS, NO_ACTION

INADMISSIBLE_LOGIT = -1e9
"""Logit of an action that is not admissible: its probability is 0 in float32, and differences of logits stay finite."""


class Perceptron(eqx.Module):
    """Layers with tanh between them; the axes of the batch come last, as in the simulation."""

    layers: tuple[eqx.nn.Linear, ...]

    def __call__(self, features: Float[Array, "features *batch"]) -> Float[Array, "outputs *batch"]:
        """Outputs of the last layer."""
        for number, layer in enumerate(self.layers):
            assert layer.bias is not None  # `make_network` builds every layer with a bias
            bias = layer.bias.reshape(-1, *(1,) * (features.ndim - 1))
            inputs = features if number == 0 else jnp.tanh(features)  # tanh only between layers
            features = jnp.tensordot(layer.weight, inputs, 1) + bias
        return features


class ActorCritic(eqx.Module):
    """Policy and value network, without shared layers.

    Attributes:
        actor: From an observation to a logit per action, in the order of `MetaAction`.
        critic: From an observation to the discounted sum of rewards expected from there on.
    """

    actor: Perceptron
    critic: Perceptron


def make_network(key: PRNGKey, *, width: int, layers: int) -> ActorCritic:
    """A network with `layers` hidden layers of `width` units each and random weights, float32.

    Weights are orthogonal matrices, times sqrt(2) in the hidden layers, 0.01 for the logits and 1 for the value; biases
    zero.

    Source: purejaxrl/ppo.py; Andrychowicz et al., What Matters In On-Policy Reinforcement Learning? (2021).
    """
    actor_key, critic_key = jax.random.split(key)
    sizes = (N_FEATURES, *(width,) * layers)
    return ActorCritic(
        _perceptron(actor_key, (*sizes, N_ACTIONS), last_scale=0.01),
        _perceptron(critic_key, (*sizes, 1), last_scale=1.0),
    )


def _perceptron(key: PRNGKey, sizes: tuple[int, ...], *, last_scale: float) -> Perceptron:
    """Layers between numbers of units, inputs first; `last_scale` multiplies the weights of the last layer."""
    layers = []
    for index, (size_in, size_out) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
        is_last = index == len(sizes) - 2
        scale = last_scale if is_last else float(np.sqrt(2))
        orthogonal = jax.nn.initializers.orthogonal(scale, dtype=jnp.float32)
        layer_key = jax.random.fold_in(key, index)
        layer = eqx.nn.Linear(size_in, size_out, dtype=jnp.float32, key=layer_key)
        values = (orthogonal(layer_key, (size_out, size_in)), jnp.zeros(size_out, jnp.float32))
        layers.append(eqx.tree_at(lambda layer: (layer.weight, layer.bias), layer, values))
    return Perceptron(tuple(layers))


def log_probabilities(
    logits: Float[Array, "actions *batch"], admissible: Bool[Array, "actions *batch"]
) -> Float[Array, "actions *batch"]:
    """Logarithm of the probability of each action.

    Inadmissible actions have probability 0, unless no action is admissible: then all are equally likely.
    """
    return jax.nn.log_softmax(jnp.where(admissible, logits, INADMISSIBLE_LOGIT), axis=0)


def greedy_actions(
    logits: Float[Array, "actions *batch"], admissible: Bool[Array, "actions *batch"]
) -> Int[Array, "*batch"]:
    """Most probable admissible action; NO_ACTION where none is admissible."""
    return _or_no_action(jnp.argmax(jnp.where(admissible, logits, -jnp.inf), axis=0), admissible)


def drawn_actions(
    key: PRNGKey, logits: Float[Array, "actions *batch"], admissible: Bool[Array, "actions *batch"]
) -> Int[Array, "*batch"]:
    """Admissible action drawn with the probabilities of the network; NO_ACTION where none is admissible."""
    drawn = jax.random.categorical(key, jnp.where(admissible, logits, -jnp.inf), axis=0)
    return _or_no_action(drawn, admissible)


def _or_no_action(actions: Int[Array, "*batch"], admissible: Bool[Array, "actions *batch"]) -> Int[Array, "*batch"]:
    return jnp.where(jnp.any(admissible, axis=0), actions.astype(jnp.int32), NO_ACTION)

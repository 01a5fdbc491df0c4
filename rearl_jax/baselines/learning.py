"""Proximal policy optimisation: gradient steps on the experience of one update.

Source: Schulman et al., Proximal Policy Optimization Algorithms (2017).
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax._typing import PRNGKey, ScalarLike
from rearl_jax.baselines.experience import Drive, advantages, share_of_action
from rearl_jax.baselines.network import ActorCritic, log_probabilities
from rearl_jax.config.ppo import PpoConfig

ADAM_EPSILON = 1e-5
"""Epsilon of Adam, which keeps its steps finite [-]. Source: purejaxrl/ppo.py."""


class Decisions(eqx.Module):
    """Decisions to learn from, in any order.

    Attributes:
        observation: Observation of the vehicle.
        admissible: Mask of the admissible actions.
        action: Action taken.
        log_share: Logarithm of the probability of that action.
        advantage: Return minus the expected return.
        target: Target value of the critic.
        weight: 1 where there was a decision, else 0.
    """

    observation: Float[Array, "features decisions"]
    admissible: Bool[Array, "actions decisions"]
    action: Int[Array, " decisions"]
    log_share: Float[Array, " decisions"]
    advantage: Float[Array, " decisions"]
    target: Float[Array, " decisions"]
    weight: Float[Array, " decisions"]


class Losses(eqx.Module):
    """Loss of a gradient step, its parts and progress.

    Attributes:
        total: The whole loss.
        policy: Clipped objective, negative.
        value: Mean squared error of the critic.
        entropy: Entropy of the actions' probabilities [nat].
        divergence: Estimated Kullback-Leibler divergence of the new from the old probabilities [nat].
        clipped_share: Share of the decisions whose gradient is clipped.
    """

    total: Float[Array, "*steps"]
    policy: Float[Array, "*steps"]
    value: Float[Array, "*steps"]
    entropy: Float[Array, "*steps"]
    divergence: Float[Array, "*steps"]
    clipped_share: Float[Array, "*steps"]


class Learner(eqx.Module):
    """State of the training: the network and its optimiser."""

    network: ActorCritic
    optimiser: optax.OptState


def make_optimiser(ppo: PpoConfig, n_updates: int, n_decisions: int) -> optax.GradientTransformation:
    """Adam with clipped gradients; with `ppo.anneal` its step size falls to zero over all updates."""
    steps = n_updates * ppo.epochs * split(n_decisions, ppo.minibatch)[0]
    rate = optax.linear_schedule(ppo.learning_rate, 0.0, steps) if ppo.anneal else ppo.learning_rate
    return optax.chain(optax.clip_by_global_norm(ppo.max_grad_norm), optax.adam(rate, eps=ADAM_EPSILON))


def split(n_decisions: int, largest: int) -> tuple[int, int]:
    """Number and size of equal minibatches of at most the largest size; fewer decisions than minibatches are left
    over.
    """
    count = math.ceil(n_decisions / largest)
    return count, n_decisions // count


def decisions_of(drive: Drive, ppo: PpoConfig) -> Decisions:
    """All decisions of some rollouts."""
    advantage = advantages(
        drive.reward, drive.value, drive.last_value, drive.crashed, gamma=ppo.gamma, decay=ppo.gae_lambda
    )

    def flat(values: Array) -> Array:
        """Axes [seconds, rows, vehicles, scenarios] -> [rows, decisions]."""
        return jnp.moveaxis(values, 1, 0).reshape(values.shape[1], -1)

    return Decisions(
        observation=flat(drive.given.observation),
        admissible=flat(drive.given.admissible),
        action=drive.action.reshape(-1),
        log_share=drive.log_share.reshape(-1),
        advantage=advantage.reshape(-1),
        target=(advantage + drive.value).reshape(-1),
        weight=drive.decides.astype(jnp.float32).reshape(-1),
    )


def loss(network: ActorCritic, decisions: Decisions, ppo: PpoConfig) -> tuple[ScalarLike, Losses]:
    """Loss of a gradient step, and its parts.

    L = -mean min(r A, clip(r, 1 - e, 1 + e) A) + c_V mean (V - V_target)^2 - c_H mean H with r the ratio of the new to
    the old probability of the action, A its advantage with mean 0 and standard deviation 1 in the minibatch, and H the
    entropy.
    """
    weight = decisions.weight
    count = jnp.maximum(jnp.sum(weight), 1.0)

    def mean(values: Float[Array, " decisions"]) -> Float[Array, ""]:
        return jnp.sum(weight * values) / count

    centred = decisions.advantage - mean(decisions.advantage)
    advantage = centred / (jnp.sqrt(mean(centred**2)) + 1e-8)
    shares = log_probabilities(network.actor(decisions.observation), decisions.admissible)
    change = share_of_action(shares, decisions.action) - decisions.log_share
    ratio = jnp.exp(change)
    clipped = jnp.clip(ratio, 1 - ppo.clip, 1 + ppo.clip)
    policy = -mean(jnp.minimum(ratio * advantage, clipped * advantage))
    value = mean((network.critic(decisions.observation)[0] - decisions.target) ** 2)
    surprise = jnp.where(decisions.admissible, jnp.exp(shares) * shares, 0.0)
    entropy = -mean(jnp.sum(surprise, axis=0))
    total = policy + ppo.value_weight * value - ppo.entropy_weight * entropy
    return total, Losses(
        total=total,
        policy=policy,
        value=value,
        entropy=entropy,
        divergence=mean(ratio - 1 - change),
        clipped_share=mean((jnp.abs(ratio - 1) > ppo.clip).astype(jnp.float32)),
    )


def improve(
    learner: Learner, decisions: Decisions, key: PRNGKey, ppo: PpoConfig, optimiser: optax.GradientTransformation
) -> tuple[Learner, Losses]:
    """The learner after all epochs over some decisions, and the losses of every gradient step, taken before it."""
    n_decisions = decisions.action.shape[0]
    count, size = split(n_decisions, ppo.minibatch)

    def step(learner: Learner, chosen: Int[Array, " decisions"]) -> tuple[Learner, Losses]:
        some = jax.tree.map(lambda leaf: jnp.take(leaf, chosen, axis=-1), decisions)
        gradients, losses = jax.grad(loss, has_aux=True)(learner.network, some, ppo)
        changes, state = optimiser.update(gradients, learner.optimiser)
        return Learner(eqx.apply_updates(learner.network, changes), state), losses

    def epoch(learner: Learner, epoch_key: PRNGKey) -> tuple[Learner, Losses]:
        order = jax.random.permutation(epoch_key, n_decisions)[: count * size]
        return lax.scan(step, learner, order.reshape(count, size))

    learner, losses = lax.scan(epoch, learner, jax.random.split(key, ppo.epochs))
    return learner, jax.tree.map(lambda leaf: leaf.reshape(-1), losses)

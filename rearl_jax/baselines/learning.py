"""Proximal policy optimisation: gradient steps on the experience of one update.

Source: Schulman et al., Proximal Policy Optimization Algorithms (2017).
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax import lax
from jaxtyping import Array, Bool, Float, Int, Shaped

from rearl_jax._typing import PRNGKey, ScalarLike
from rearl_jax.baselines.experience import Experience, advantages, value_of_action
from rearl_jax.baselines.network import ActorCritic, log_probabilities
from rearl_jax.config.ppo import PpoConfig

ADAM_EPSILON = 1e-5
"""Epsilon of Adam, which keeps the step size finite [-]. Source: purejaxrl/ppo.py."""


class Decisions(eqx.Module):
    """Decisions to learn from, in any order.

    Attributes:
        observation: Observation of the vehicle.
        admissible: Mask of the admissible actions.
        action: Action taken.
        log_probability: Logarithm of the probability of that action.
        advantage: Return minus the expected return.
        target: Target value of the critic.
        weight: 1 where there was a decision, else 0.
    """

    observation: Float[Array, "features decisions"]
    admissible: Bool[Array, "actions decisions"]
    action: Int[Array, " decisions"]
    log_probability: Float[Array, " decisions"]
    advantage: Float[Array, " decisions"]
    target: Float[Array, " decisions"]
    weight: Float[Array, " decisions"]


class Losses(eqx.Module):
    """Loss of a gradient step, its parts, and two measures of the policy's change.

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
    """Number of equal minibatches, and their size, at most `largest`.

    The decisions left over are fewer than the minibatches.
    """
    count = math.ceil(n_decisions / largest)
    return count, n_decisions // count


def decisions_of(experience: Experience, ppo: PpoConfig) -> Decisions:
    """All decisions of some rollouts."""
    advantage = advantages(
        experience.reward,
        experience.value,
        experience.last_value,
        experience.crashed,
        gamma=ppo.gamma,
        decay=ppo.gae_lambda,
    )

    def flat(values: Shaped[Array, "seconds rows vehicles scenarios"]) -> Shaped[Array, "rows decisions"]:
        return jnp.moveaxis(values, 1, 0).reshape(values.shape[1], -1)

    return Decisions(
        observation=flat(experience.inputs.observation),
        admissible=flat(experience.inputs.admissible),
        action=experience.action.reshape(-1),
        log_probability=experience.log_probability.reshape(-1),
        advantage=advantage.reshape(-1),
        target=(advantage + experience.value).reshape(-1),
        weight=experience.decides.astype(jnp.float32).reshape(-1),
    )


def loss(network: ActorCritic, decisions: Decisions, ppo: PpoConfig) -> tuple[ScalarLike, Losses]:
    """Loss of a gradient step, and its parts.

    L = -mean min(r A, clip(r, 1 - e, 1 + e) A) + c_V mean (V - V_target)^2 - c_H mean H

    r is the ratio of the new to the old probability of the action, A its advantage, standardised in the minibatch, V
    the value of the critic and H the entropy; e is `ppo.clip`, c_V `ppo.value_weight`, c_H `ppo.entropy_weight`.
    """
    weight = decisions.weight
    count = jnp.maximum(jnp.sum(weight), 1.0)

    def mean(values: Float[Array, " decisions"]) -> Float[Array, ""]:
        return jnp.sum(weight * values) / count

    centred = decisions.advantage - mean(decisions.advantage)
    advantage = centred / (jnp.sqrt(mean(centred**2)) + 1e-8)
    log_probability = log_probabilities(network.actor(decisions.observation), decisions.admissible)
    log_ratio = value_of_action(log_probability, decisions.action) - decisions.log_probability
    ratio = jnp.exp(log_ratio)
    clipped = jnp.clip(ratio, 1 - ppo.clip, 1 + ppo.clip)
    policy = -mean(jnp.minimum(ratio * advantage, clipped * advantage))
    value = mean((network.critic(decisions.observation)[0] - decisions.target) ** 2)
    p_log_p = jnp.where(decisions.admissible, jnp.exp(log_probability) * log_probability, 0.0)
    entropy = -mean(jnp.sum(p_log_p, axis=0))
    total = policy + ppo.value_weight * value - ppo.entropy_weight * entropy
    return total, Losses(
        total=total,
        policy=policy,
        value=value,
        entropy=entropy,
        divergence=mean(ratio - 1 - log_ratio),
        clipped_share=mean((jnp.abs(ratio - 1) > ppo.clip).astype(jnp.float32)),
    )


def improve(
    learner: Learner, decisions: Decisions, key: PRNGKey, ppo: PpoConfig, optimiser: optax.GradientTransformation
) -> tuple[Learner, Losses]:
    """The learner after all epochs over the decisions, and the losses before each gradient step."""
    n_decisions = decisions.action.shape[0]
    count, size = split(n_decisions, ppo.minibatch)

    def step(learner: Learner, index: Int[Array, " decisions"]) -> tuple[Learner, Losses]:
        minibatch = jax.tree.map(lambda leaf: jnp.take(leaf, index, axis=-1), decisions)
        gradients, losses = jax.grad(loss, has_aux=True)(learner.network, minibatch, ppo)
        changes, state = optimiser.update(gradients, learner.optimiser)
        return Learner(eqx.apply_updates(learner.network, changes), state), losses

    def epoch(learner: Learner, epoch_key: PRNGKey) -> tuple[Learner, Losses]:
        order = jax.random.permutation(epoch_key, n_decisions)[: count * size]
        return lax.scan(step, learner, order.reshape(count, size))

    learner, losses = lax.scan(epoch, learner, jax.random.split(key, ppo.epochs))
    return learner, jax.tree.map(lambda leaf: leaf.reshape(-1), losses)

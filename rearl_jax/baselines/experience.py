"""Experience for the training: rollouts with actions drawn from the policy, and their rewards and advantages."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax._typing import PRNGKey
from rearl_jax.baselines.driving import DrivenTraffic, DrivingOptions, PolicyInput, begin, drive, policy_input
from rearl_jax.baselines.network import ActorCritic, drawn_actions, log_probabilities
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import TrafficState
from rearl_jax.decision.reward import reward
from rearl_jax.decision.situation import N_ACTIONS


class Experience(eqx.Module):
    """Rollouts second by second.

    Attributes:
        inputs: Input of the policy before each second.
        action: Action followed in the second, NO_ACTION for none.
        log_probability: Logarithm of the probability of this action.
        value: Sum of the discounted rewards to come that the critic expects before the second.
        reward: Reward for the second.
        speed: Speed at the end of the second [m/s].
        crashed: Whether the vehicle had crashed by the end of the second.
        last_value: The same after the last second.
    """

    inputs: PolicyInput
    action: Int[Array, "seconds vehicles scenarios"]
    log_probability: Float[Array, "seconds vehicles scenarios"]
    value: Float[Array, "seconds vehicles scenarios"]
    reward: Float[Array, "seconds vehicles scenarios"]
    speed: Float[Array, "seconds vehicles scenarios"]
    crashed: Bool[Array, "seconds vehicles scenarios"]
    last_value: Float[Array, "vehicles scenarios"]

    @property
    def decides(self) -> Bool[Array, "seconds vehicles scenarios"]:
        """Mask of the seconds with a decision; there is none after a crash."""
        return jnp.any(self.inputs.admissible, axis=1)

    @property
    def drives(self) -> Bool[Array, "seconds vehicles scenarios"]:
        """Mask of the seconds that a vehicle begins without having crashed."""
        return jnp.concatenate([jnp.ones_like(self.crashed[:1]), ~self.crashed[:-1]])


def collect(
    state: TrafficState,
    drivers: Drivers,
    network: ActorCritic,
    key: PRNGKey,
    model: TrafficModel,
    options: DrivingOptions,
    *,
    n_seconds: int,
) -> Experience:
    """Rollouts in which the action of each vehicle is drawn from the policy."""
    model = options.model(model)
    # As in `core.rollout.rollout`: XLA must not propagate constants of the initial state into the loop.
    state, drivers = lax.optimization_barrier((state, drivers))

    def second(driven: DrivenTraffic, number: Array) -> tuple[DrivenTraffic, tuple[PolicyInput, tuple[Array, ...]]]:
        inputs = policy_input(driven[0], drivers, model, options)
        logits = network.actor(inputs.observation)
        action = drawn_actions(jax.random.fold_in(key, number), logits, inputs.admissible)
        log_probability = value_of_action(log_probabilities(logits, inputs.admissible), action)
        after = drive(driven, action, inputs, drivers, model, options)
        end = after[0]
        earned, speed = reward(end, model).astype(jnp.float32), end.speed.astype(jnp.float32)
        return after, (inputs, (action, log_probability, earned, speed, end.crashed))

    seconds = jnp.arange(n_seconds, dtype=jnp.int32)
    (end, _), (inputs, outcomes) = lax.scan(second, begin(state, model), seconds)
    action, log_probability, earned, speed, crashed = outcomes
    value = network.critic(jnp.moveaxis(inputs.observation, 1, 0))[0]
    last = network.critic(policy_input(end, drivers, model, options).observation)[0]
    return Experience(inputs, action, log_probability, value, earned, speed, crashed, last)


def value_of_action(values: Float[Array, "actions *batch"], action: Int[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Value of the given action, from the values of all actions; 0 for NO_ACTION."""
    return sum(
        (jnp.where(action == index, values[index], 0.0) for index in range(N_ACTIONS)),
        start=jnp.zeros(action.shape, values.dtype),
    )


def advantages(
    reward: Float[Array, "seconds *batch"],
    value: Float[Array, "seconds *batch"],
    last_value: Float[Array, "*batch"],
    ends: Bool[Array, "seconds *batch"],
    *,
    gamma: float,
    decay: float,
) -> Float[Array, "seconds *batch"]:
    """Generalised advantage estimate of every second.

    A_t = d_t + gamma lambda (1 - end_t) A_{t+1}, with the error of the critic
    d_t = r_t + gamma (1 - end_t) V_{t+1} - V_t.

    A crash ends a vehicle's driving. The end of the rollout does not: there the value replaces the rewards that would
    follow.

    Args:
        reward: r_t, reward for each second.
        value: V_t, value before each second.
        last_value: V after the last second.
        ends: end_t, whether the vehicle's driving ends with the second.
        gamma: Discount of a second [-].
        decay: lambda [-].

    Source: Schulman et al., High-Dimensional Continuous Control Using Generalized Advantage Estimation (2016).
    """
    continues = 1 - ends.astype(reward.dtype)
    next_value = jnp.concatenate([value[1:], last_value[None]])
    error = reward + gamma * continues * next_value - value

    def back(next_advantage: Array, second: tuple[Array, Array]) -> tuple[Array, Array]:
        error, continues = second
        advantage = error + gamma * decay * continues * next_advantage
        return advantage, advantage

    return lax.scan(back, jnp.zeros_like(last_value), (error, continues), reverse=True)[1]

"""Policies that record every decision: vehicle, second and action.

The closed loop inside the compiled program stores only counts. Here its policy decides outside, in lockstep, which
gives the same traffic bit for bit.
"""

import functools
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, Key

from rearl_jax.core.model import TrafficModel
from rearl_jax.decision.execution import accept
from rearl_jax.decision.lockstep import HostPolicy
from rearl_jax.decision.policies import make_policy
from rearl_jax.decision.situation import Situation
from rearl_jax.detection.table import ReferenceTable
from rearl_jax.evaluation.host_policy import Block, MakePolicy
from rearl_jax.evaluation.simulators import Interventions
from rearl_jax.replay.scenes import Decision


@dataclass
class DecisionRecorder:
    """Maker of policies that record what they decide.

    Attributes:
        make: Maker of the policies that decide.
        decisions: Decisions so far, of all these policies.
    """

    make: MakePolicy
    decisions: list[Decision] = field(default_factory=list)

    def __call__(self, block: Block) -> HostPolicy:
        """A policy for some scenarios; see `host_policy.MakePolicy`."""
        return _RecordedPolicy(self.make(block), block.first_scenario, self.decisions)


@dataclass(frozen=True)
class _RecordedPolicy:
    policy: HostPolicy
    first_scenario: int
    decisions: list[Decision]

    def ask(self, situation: Situation) -> Future[np.ndarray]:
        """The policy's answer, after the decision on each vehicle that was asked has been recorded."""
        answer = self.policy.ask(situation)
        mask, admissible = jnp.asarray(situation.detection.mask), jnp.asarray(situation.admissible)
        orders = accept(jnp.asarray(answer.result()), mask, admissible)
        asked, followed, second = np.asarray(orders.is_asked), np.asarray(orders.action), int(situation.second)
        self.decisions.extend(
            Decision(self.first_scenario + int(rollout), second, int(vehicle), int(followed[vehicle, rollout]))
            for rollout, vehicle in np.argwhere(asked.T)
        )
        return answer


def policy_of(acts: Interventions, keys: Key[Array, " rollouts"]) -> MakePolicy:
    """Maker of policies that decide as the one inside the compiled program does, from one random key per rollout."""

    def make(block: Block) -> HostPolicy:
        block_keys = keys[block.first_scenario : block.first_scenario + block.length.shape[-1]]
        return _Compiled(functools.partial(_compiled(acts, block.model), table=block.table, keys=block_keys))

    return make


@functools.cache
def _compiled(acts: Interventions, model: TrafficModel) -> Callable[..., Array]:
    policy = make_policy(acts.policy, acts.matcher, model)

    def decide(
        situation: Situation, table: ReferenceTable, keys: Key[Array, " rollouts"]
    ) -> Int[Array, "vehicles rollouts"]:
        second_keys = jax.vmap(lambda key: jax.random.fold_in(key, situation.second))(keys)
        return policy(situation, table, second_keys)

    return jax.jit(decide)


@dataclass(frozen=True)
class _Compiled:
    decide: Callable[[Situation], Array]

    def ask(self, situation: Situation) -> Future[np.ndarray]:
        """The answer, at once."""
        answer: Future[np.ndarray] = Future()
        answer.set_result(np.asarray(self.decide(situation)))
        return answer

"""Traffic in which one policy controls all vehicles: each second consists of observation, decision and simulation."""

import dataclasses
from typing import TypeAlias

import equinox as eqx
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.baselines.network import Perceptron, greedy_actions
from rearl_jax.baselines.observation import observe_neighbours
from rearl_jax.config.decision import AdmissibleConfig, ExecConfig, Longitudinal
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, frame_of, simulate_second
from rearl_jax.core.state import Controller, TrafficState
from rearl_jax.decision.admissible import admissible_actions
from rearl_jax.decision.execution import (
    DecisionMemory,
    accept,
    execute,
    initial_decision_memory,
    model_under_decisions,
)


@dataclasses.dataclass(frozen=True)
class DrivingOptions:
    """Options that change the compiled program: rules of admissible actions, and control of the speed."""

    admissible: AdmissibleConfig = dataclasses.field(default_factory=AdmissibleConfig)
    longitudinal: Longitudinal = Longitudinal.mdp

    def model(self, model: TrafficModel) -> TrafficModel:
        """The road with the stages that vehicles under decisions need."""
        return model_under_decisions(model, self.longitudinal)


class PolicyInput(eqx.Module):
    """Input of the policy for every vehicle.

    Attributes:
        observation: See `observe_neighbours`.
        admissible: Mask of the admissible actions; none if the vehicle has crashed.
    """

    observation: Float[Array, "features vehicles scenarios"]
    admissible: Bool[Array, "actions vehicles scenarios"]


DrivenTraffic: TypeAlias = tuple[TrafficState, DecisionMemory]
"""The vehicles, and the memory of their decisions."""


def begin(state: TrafficState, model: TrafficModel) -> DrivenTraffic:
    """The vehicles before the first decision."""
    return state, initial_decision_memory(state, model)


def policy_input(state: TrafficState, drivers: Drivers, model: TrafficModel, options: DrivingOptions) -> PolicyInput:
    """Input of the policy for every vehicle."""
    return PolicyInput(observe_neighbours(state), admissible_actions(state, drivers, model, options.admissible))


def drive(
    driven: DrivenTraffic,
    actions: Int[Array, "vehicles scenarios"],
    inputs: PolicyInput,
    drivers: Drivers,
    model: TrafficModel,
    options: DrivingOptions,
) -> DrivenTraffic:
    """The vehicles one second later, after each has followed its action or, without an action, IDM and MOBIL."""
    state, memory = driven
    is_there = state.controller != Controller.ABSENT
    orders = accept(actions, is_there, inputs.admissible)
    execution = ExecConfig(longitudinal=options.longitudinal)
    state, memory = execute(state, memory, orders, model, execution)
    return simulate_second(state, drivers, model), memory


def rollout_with_actor(
    state: TrafficState,
    drivers: Drivers,
    actor: Perceptron,
    model: TrafficModel,
    options: DrivingOptions,
    *,
    n_seconds: int,
) -> tuple[Frames, Int[Array, "seconds vehicles scenarios"]]:
    """A frame after every second, and the actions followed during it; each vehicle takes its most probable action."""
    model = options.model(model)
    # As in `core.rollout.rollout`: XLA must not propagate constants of the initial state into the loop.
    state, drivers = lax.optimization_barrier((state, drivers))

    def second(driven: DrivenTraffic, _: None) -> tuple[DrivenTraffic, tuple[Frames, Array]]:
        inputs = policy_input(driven[0], drivers, model, options)
        actions = greedy_actions(actor(inputs.observation), inputs.admissible)
        driven = drive(driven, actions, inputs, drivers, model, options)
        return driven, (frame_of(driven[0], model), actions)

    return lax.scan(second, begin(state, model), None, length=n_seconds)[1]

"""The rollouts of an evaluation: their order, their initial states, and their traffic chunk by chunk."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, Key

from rearl_jax._typing import SceneIndices
from rearl_jax.baselines.weights import TrainedPolicy, load_policy
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.core.boundary import Boundary
from rearl_jax.core.model import traffic_model
from rearl_jax.data.scenes.boundary import SceneBoundary
from rearl_jax.data.scenes.initial_states import bounded_state, measured_state, recorded_surroundings
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.decision.execution import model_under_decisions
from rearl_jax.detection.detector import Thresholds
from rearl_jax.detection.references import References
from rearl_jax.evaluation.boundaries import check_boundary, recorded_boundary
from rearl_jax.evaluation.host_policy import MakePolicy, simulate_with_host_policy
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.simulators import (
    Batch,
    Interventions,
    Simulated,
    decision_keys,
    interventions,
    program,
    rollout_keys,
    start_program,
)
from rearl_jax.evaluation.traffic import with_road
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

NO_SCENE = -1
"""Takes the place of scene_id in random keys, to draw initial states that belong to no scene."""


class Rollouts:
    """The rollouts of an evaluation, ordered by row, then by run, then by scene.

    Only their numbers are stored, so that a million rollouts take no memory; row, run and scene follow from the number.

    Attributes:
        policy: Trained policy that drives all vehicles; None if none does.
        boundary: Recorded traffic around the scenes; None for a free road.
    """

    def __init__(
        self,
        rows: Sequence[Row],
        scenes: SceneSet,
        held_out: SceneIndices,
        references: References | None = None,
        host_policy: MakePolicy | None = None,
        *,
        apart: bool = False,
    ) -> None:
        """Counts the rollouts; nothing is simulated yet.

        Args:
            rows: Rows of one configuration and the same drivers, which may differ in thresholds and in shares of driver
                classes; every row gets the same initial states.
            scenes: All scenes.
            held_out: Indices of those to be simulated.
            references: Representative scenes, for methods that intervene.
            host_policy: Makes the policies that decide outside the compiled program. Required if the configured policy
                does (`PolicyName.is_outside`); may also be given to record every decision of another policy.
            apart: Whether to draw initial states that no evaluation uses; requires eval.seed_scope=run.
        """
        config = with_road(rows[0].config, scenes)
        check_boundary(config)
        self.config, self._n_seconds, self._host_policy = config, scenes.seconds, host_policy
        is_shared = config.eval.seed_scope is SeedScope.run
        self._served = held_out[:1] if is_shared else held_out
        shared_id = np.full(1, NO_SCENE if apart else 0, np.int32)
        self._scene_id = shared_id if is_shared else scenes.scene_id[held_out].astype(np.int32)
        self._n_runs = config.eval.n_runs
        self._numbers = range(len(rows) * self._n_runs * len(self._served))
        self._traffic = jax.tree.map(_with_scenario_axis, rows[0].population)
        self._is_cooperative = rows[0].is_cooperative
        self._references = self._thresholds = self._shares = None
        self.policy: TrainedPolicy | None = None
        if config.method is Method.critical:
            self._shares = np.array([_mixture(row) for row in rows], config.core.dtype.name).T
        if config.method is Method.ppo:
            self.policy = load_policy(config.ppo.weights, config.core)
        if config.method.needs_references:
            if references is None:
                message = "needs references to compare the traffic with"
                raise InvalidInputError(Problem("references-missing", message, key=f"method={config.method.name}"))
            self._references = jax.tree.map(_with_scenario_axis, references)
            self._thresholds = np.array([row.thresholds for row in rows], config.core.dtype.name).T
        self._state = self._surroundings = None
        self.boundary: SceneBoundary | None = None
        if config.init.source is InitialSource.scene:
            if is_shared:
                message = "must be run_x_scene for init.source=scene, which starts every rollout from its own scene"
                raise out_of_range("eval.seed_scope", message, config.eval.seed_scope.name)
            self.boundary = recorded_boundary(config, scenes, held_out)
            if self.boundary is None:
                state = measured_state(scenes.select(held_out), config.core)
            else:
                state, table = (
                    bounded_state(self.boundary, config.core),
                    recorded_surroundings(self.boundary, config.core),
                )
                motion, identity, entrants = jax.tree.map(
                    _with_scenario_axis, (table.motion, table.identity, table.entrants)
                )
                self._surroundings = Boundary(motion, identity, entrants, np.asarray(table.scene))
            self._state = jax.tree.map(np.asarray, state)

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, part: slice) -> "Rollouts":
        """A part of the rollouts."""
        selected = copy(self)
        selected._numbers = self._numbers[part]
        return selected

    @property
    def row(self) -> Int[np.ndarray, " rollouts"]:
        """Index of the row of each rollout."""
        return self._index // (self._n_runs * len(self._served))

    @property
    def run(self) -> Int[np.ndarray, " rollouts"]:
        """Run of each rollout."""
        return (self._index // len(self._served) % self._n_runs).astype(np.int32)

    @property
    def scene(self) -> Int[np.ndarray, " rollouts"]:
        """Index of the scene of each rollout; with eval.seed_scope=run every rollout serves all scenes."""
        return self._served[self.column]

    @property
    def column(self) -> Int[np.ndarray, " rollouts"]:
        """Index of each rollout's scene among the simulated scenes."""
        return self._index % len(self._served)

    @property
    def _index(self) -> Int[np.ndarray, " rollouts"]:
        return np.arange(self._numbers.start, self._numbers.stop, self._numbers.step)

    def chunks(self) -> Iterator[Simulated]:
        """Rollouts chunk by chunk, in the order of `row`, `run` and `scene`."""
        config = self.config
        control = interventions(config) if self.policy is None else self.policy.options
        if isinstance(control, Interventions) and (control.policy.is_outside or self._host_policy is not None):
            return self._decided_on_host(control)
        simulate = program(control, config.core, config.init.speed, self._n_seconds, self._is_cooperative)
        return simulate.chunks(self._batch())

    @property
    def decision_keys(self) -> Key[Array, " rollouts"]:
        """Random keys of the policy, from which it draws those of each second."""
        return decision_keys(rollout_keys(self._batch().starts))

    def _batch(self) -> Batch:
        """Input of the simulation."""
        column, row = self.column, self.row
        starts = {
            "seed": np.full(len(self), self.config.eval.seed, np.int32),
            "run": self.run,
            "scene_id": self._scene_id[column],
        }
        return Batch(
            starts,
            measured=jax.tree.map(lambda leaf: leaf[..., column], self._state),
            references=self._references,
            thresholds=None if self._thresholds is None else tuple(self._thresholds[:, row]),
            actor=None if self.policy is None else jax.tree.map(_with_scenario_axis, self.policy.network.actor),
            shares=None if self._shares is None else self._shares[:, row],
            traffic=self._traffic,
            boundary=None if self._surroundings is None else replace(self._surroundings, scene=column.astype(np.int32)),
        )

    def _decided_on_host(self, control: Interventions) -> Iterator[Simulated]:
        """Rollouts with the decisions of a policy outside the compiled program."""
        if self._host_policy is None:
            message = "decides outside the program, so `host_policy` must be given"
            raise InvalidInputError(Problem("policy-outside", message, key=f"decision.policy={control.policy.name}"))
        config, batch = self.config, self._batch()
        if self.boundary is not None:
            message = "cannot be decided outside the compiled program"
            key, value = "scenes.boundary", config.scenes.boundary.name
            raise InvalidInputError(Problem("policy-outside", message, "set it to free", key=key, value=value))
        assert batch.thresholds is not None  # set for every method that intervenes
        model = traffic_model(config.core, cooperative=self._is_cooperative)
        state, drivers, keys, table = start_program(config.core, config.init.speed, control.loop.detection)(batch)
        return simulate_with_host_policy(
            state,
            drivers,
            keys,
            table,
            Thresholds(*map(jnp.asarray, batch.thresholds)),
            self._host_policy,
            model_under_decisions(model, control.loop.execution.longitudinal),
            control.loop,
            n_seconds=self._n_seconds,
        )


def _with_scenario_axis(leaf: Array | np.ndarray) -> np.ndarray:
    """An array with a last axis of length 1: the same for all scenarios."""
    return np.asarray(leaf)[..., None]


def _mixture(row: Row) -> Sequence[float]:
    """Shares of the driver classes of a row, or the configured ones if the row has none."""
    shares = row.config.critical.ratios if row.mixture is None else row.mixture
    if shares is None:
        message = (
            "must be the shares of the driver classes for method=critical: set "
            "critical.ratios=[AGGRESSIVE,DEFENSIVE,TRUCK]; `rearl evaluate method=critical` finds such shares and "
            "prints them"
        )
        raise InvalidInputError(Problem("key-missing", message, key="critical.ratios"))
    return shares

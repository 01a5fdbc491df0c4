"""Which rollouts an evaluation has, where they begin, and their traffic chunk by chunk."""

from collections.abc import Iterator, Sequence
from copy import copy

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, Key

from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.baselines.weights import TrainedPolicy, load_policy
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.core.road import traffic_model
from rearl_jax.core.state import TrafficState
from rearl_jax.data.initial_states import measured_state
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.decision.execution import model_under_decisions
from rearl_jax.detection.detector import Thresholds
from rearl_jax.detection.references import References
from rearl_jax.evaluation.outside import MakePolicy, simulate_outside
from rearl_jax.evaluation.simulators import (
    NEVER,
    Batch,
    Interventions,
    Simulated,
    beginnings,
    decision_keys,
    interventions,
    program,
    rollout_keys,
)
from rearl_jax.evaluation.traffic import is_cooperative, population_of
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

NO_SCENE = -1
"""In the place of a scene_id: rollouts that share no initial state with those of any scene, whatever seed and run."""


class Rollouts:
    """The rollouts of an evaluation: numbers, so that a million of them take no memory; all else follows from them.

    They are ordered by cell (thresholds, or shares of driver classes), then by run, then by scene.
    """

    def __init__(
        self,
        config: EvaluateTask,
        scenes: SceneSet,
        held_out: np.ndarray,
        references: References | None = None,
        thresholds: Sequence[tuple[float, float]] = (NEVER,),
        outside: MakePolicy | None = None,
        *,
        mixtures: Sequence[Mixture] = (),
        apart: bool = False,
    ) -> None:
        """Counts the rollouts; nothing is simulated yet.

        Args:
            config: Method, road, initial states, runs and seeds.
            scenes: All scenes.
            held_out: Indices of those to be simulated.
            references: Representative scenes, for methods that intervene.
            thresholds: Of the Hellinger distance and of the spacing error, for methods that intervene; every pair gets
                the same rollouts.
            outside: Makes the policies that decide outside the compiled program; needed for `PolicyName.is_outside`,
                and whoever wants to see every decision of another policy gives one too.
            mixtures: Shares of the driver classes, for method=critical; every mixture gets the same rollouts. By
                default that of `critical.ratios`.
            apart: Whether initial states are drawn that no evaluation has; needs eval.seed_scope=run.
        """
        self._config, self._n_seconds, self._outside = config, scenes.seconds, outside
        is_shared = config.eval.seed_scope is SeedScope.run
        self._served = held_out[:1] if is_shared else held_out
        shared_id = np.full(1, NO_SCENE if apart else 0, np.int32)
        self._scene_id = shared_id if is_shared else scenes.scene_id[held_out].astype(np.int32)
        self._n_runs = config.eval.n_runs
        self._shares = None
        if config.method is Method.critical:
            self._shares = np.array(_mixtures(config, mixtures), config.core.dtype.name).T
        n_cells = len(thresholds) if self._shares is None else self._shares.shape[1]
        self._numbers = range(n_cells * self._n_runs * len(self._served))
        # A last axis of length 1: the same for all scenarios.
        self._traffic = jax.tree.map(lambda leaf: np.asarray(leaf)[..., None], population_of(config))
        self._references = self._thresholds = None
        self._policy: TrainedPolicy | None = None
        if config.method is Method.ppo:
            self._policy = load_policy(config.ppo.weights, config.core)
        if config.method.needs_references:
            if references is None:
                said = "needs references to hold the traffic against"
                raise InvalidInputError(Problem("references-missing", said, key=f"method={config.method.name}"))
            self._references = references
            self._thresholds = np.array(thresholds, config.core.dtype.name).T
        self._state = None
        if config.init.source is InitialSource.scene:
            if is_shared:
                said = "must be run_x_scene for init.source=scene, which starts every rollout from its own scene"
                raise out_of_range("eval.seed_scope", said, config.eval.seed_scope.name)
            self._state = jax.tree.map(np.asarray, measured_state(scenes.select(held_out), config.core))

    @property
    def policy(self) -> TrainedPolicy | None:
        """Who drives all vehicles, None for nobody."""
        return self._policy

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, part: slice) -> "Rollouts":
        """Some of them."""
        some = copy(self)
        some._numbers = self._numbers[part]
        return some

    @property
    def cell(self) -> Int[np.ndarray, " rollouts"]:
        """Index of the thresholds, or of the mixture, of each rollout."""
        return self._index // (self._n_runs * len(self._served))

    @property
    def run(self) -> Int[np.ndarray, " rollouts"]:
        """Run of each rollout."""
        return (self._index // len(self._served) % self._n_runs).astype(np.int32)

    @property
    def scene(self) -> Int[np.ndarray, " rollouts"]:
        """Index of the scene of each rollout; with eval.seed_scope=run every rollout serves all scenes."""
        return self._served[self._column]

    @property
    def _column(self) -> Int[np.ndarray, " rollouts"]:
        """Place of each rollout's scene among those served."""
        return self._index % len(self._served)

    @property
    def _index(self) -> Int[np.ndarray, " rollouts"]:
        return np.arange(self._numbers.start, self._numbers.stop, self._numbers.step)

    def chunks(self, width: int) -> Iterator[Simulated]:
        """Rollouts chunk by chunk, scenarios in the order of `run` and `scene`.

        Args:
            width: Scenarios a device takes at a time.
        """
        config = self._config
        policy = self._policy
        acts = interventions(config) if policy is None else policy.options
        if isinstance(acts, Interventions) and (acts.policy.is_outside or self._outside is not None):
            return self._decided_outside(acts)
        simulate = program(
            config.method, acts, config.core, config.init.speed, self._n_seconds, width, is_cooperative(config)
        )
        thresholds = None if self._thresholds is None else tuple(self._thresholds[:, self.cell])
        # A last axis of length 1: the same for all scenarios.
        references, actor = jax.tree.map(
            lambda leaf: np.asarray(leaf)[..., None],
            (self._references, None if policy is None else policy.network.actor),
        )
        shares = None if self._shares is None else self._shares[:, self.cell]
        return simulate.chunks(Batch(*self._starts(), references, thresholds, actor, shares, self._traffic))

    @property
    def decision_keys(self) -> Key[Array, " rollouts"]:
        """Random keys of the policy, from which it draws those of each second."""
        return decision_keys(rollout_keys(self._starts()[0]))

    def _starts(self) -> tuple[dict[str, np.ndarray], TrafficState | None]:
        """Seeds, and initial states where they are measured."""
        column = self._column
        starts = {
            "seed": np.full(len(self), self._config.eval.seed, np.int32),
            "run": self.run,
            "scene_id": self._scene_id[column],
        }
        return starts, jax.tree.map(lambda leaf: leaf[..., column], self._state)

    def _decided_outside(self, acts: Interventions) -> Iterator[Simulated]:
        """The same, with the policy outside the compiled program."""
        assert self._thresholds is not None  # the method needs them
        if self._outside is None:
            said = "decides outside the program: say who is to be asked"
            raise InvalidInputError(Problem("policy-outside", said, key=f"decision.policy={acts.policy.name}"))
        config = self._config
        start = beginnings(config.core, config.init.speed, acts.loop.detection)
        state, drivers, keys, table = start(*self._starts(), self._references, self._traffic)
        return simulate_outside(
            state,
            drivers,
            keys,
            table,
            Thresholds(*map(jnp.asarray, self._thresholds[:, self.cell])),
            self._outside,
            model_under_decisions(
                traffic_model(config.core, cooperative=is_cooperative(config)), acts.loop.execution.longitudinal
            ),
            acts.loop,
            n_seconds=self._n_seconds,
        )


def _mixtures(config: EvaluateTask, mixtures: Sequence[Mixture]) -> Sequence[tuple[float, ...]]:
    """The mixtures given, else the one that is configured."""
    if mixtures:
        return mixtures
    if config.critical.ratios is None:
        said = (
            "must be the shares of the driver classes for method=critical: set "
            "critical.ratios=[AGGRESSIVE,DEFENSIVE,TRUCK]; `rearl evaluate method=critical` finds such shares and "
            "prints them"
        )
        raise InvalidInputError(Problem("key-missing", said, key="critical.ratios"))
    return [config.critical.ratios]

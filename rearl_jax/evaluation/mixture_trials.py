"""Mixtures of driver classes tried out: all in one batch, every rollout scored against every threshold scene."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Float

from rearl_jax.baselines.critical.adaptation import Assessment
from rearl_jax.baselines.critical.asking import NEAR_MISS
from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitConfig
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.runner import make_scorer
from rearl_jax.evaluation.scores import scores_of
from rearl_jax.evaluation.simulators import Simulated


class Assessor:
    """Tries mixtures out; see `baselines.critical.adaptation.Assess`.

    Initial states are of their own, drawn as highway-env does whatever `init.source` says, and the same in every call.

    Attributes:
        progress: Called with the number of rollouts scored and their total.
    """

    def __init__(self, config: EvaluateTask, scenes: SceneSet, subset: np.ndarray) -> None:
        """Nothing is simulated yet.

        Args:
            config: The task.
            scenes: All scenes.
            subset: Indices of the scenes to score against.
        """
        self._n_rollouts = config.critical.rollouts
        self._config = replace(
            config,
            init=InitConfig(speed=config.init.speed),
            eval=replace(config.eval, n_runs=self._n_rollouts, seed_scope=SeedScope.run),
            safety=replace(config.safety, ttc=NEAR_MISS),
        )
        self._scenes, self._subset = scenes, subset
        self._scorer, _ = make_scorer(self._config, scenes, self._n_rollouts * len(subset))
        self.progress: Callable[[int, int], None] = lambda done, total: None

    def __call__(self, candidates: Sequence[Mixture]) -> list[Assessment]:
        """What the rollouts of each mixture come to.

        Raises:
            ValueError: There is no Hellinger distance or no spacing error.
        """
        rollouts = Rollouts(self._config, self._scenes, self._subset, mixtures=candidates, apart=True)
        parts: list[dict[str, np.ndarray]] = []
        done = 0
        width = -(-len(rollouts) // len(jax.local_devices()))
        for simulated in rollouts.chunks(min(self._config.core.chunk, width)):
            n = simulated.frames.x.shape[-1]
            # A few at a time: every rollout is scored against every scene.
            for start in range(0, n, self._n_rollouts):
                columns = np.arange(start, min(start + self._n_rollouts, n))
                parts.append(self._scored(simulated, columns))
                self.progress(done + int(columns[-1]) + 1, len(rollouts))
            done += n
        found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        cells = (rollouts.cell == number for number in range(len(candidates)))
        return [self._assessment({name: values[own] for name, values in found.items()}) for own in cells]

    def _scored(self, simulated: Simulated, columns: np.ndarray) -> dict[str, Float[np.ndarray, "rollouts scenes"]]:
        """Figures of some rollouts against every scene."""
        rollout, scene = np.repeat(columns, len(self._subset)), np.tile(self._subset, len(columns))
        metrics = self._scorer.simulated(simulated, rollout, scene)
        scores = scores_of(self._config.method.name, scene, rollout, metrics, seconds=0.0)
        figures = {
            "h": scores.values["h"],
            "mape": scores.values[self._config.mape.column],
            "crashed": scores.values["collisions"],
            "near_misses": np.nan_to_num(scores.values["ttc_share"]) * scores.counts["ttc_share"],
        }
        return {name: values.reshape(len(columns), -1) for name, values in figures.items()}

    def _assessment(self, found: dict[str, Float[np.ndarray, "rollouts scenes"]]) -> Assessment:
        """The figures of one mixture; crashes and near misses are the same against every scene."""
        errors = {name: found[name][np.isfinite(found[name])] for name in ("h", "mape")}
        for name, values in errors.items():
            if not len(values):
                raise ValueError(f"a mixture of driver classes gave no {name}, so it cannot be compared with others")
        n_vehicles = self._config.core.n_vehicles
        crashed, near_misses = (float(found[name][:, 0].sum()) for name in ("crashed", "near_misses"))
        return Assessment(
            h=float(errors["h"].mean()),
            mape=float(errors["mape"].mean()),
            crashed=round(crashed * n_vehicles),
            near_misses=round(near_misses),
            n_vehicles=n_vehicles * len(found["h"]),
        )

"""The comparison of car-following models as a step of a discovery: computed once per data set, stored and reported."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from rearl_jax.config import DiscoverConfig
from rearl_jax.discovery.comparison.choice import Choice, choice_of, is_beaten
from rearl_jax.discovery.comparison.compared import (
    MOST_CHECKED,
    MOST_FITTED,
    ModelPredictions,
    compared_models,
    compared_table,
    gains_of,
    read_compared,
)
from rearl_jax.discovery.observe.base import Base
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.report.error_block import STATISTICS
from rearl_jax.discovery.report.protocols import PROTOCOL_MEASURES, PROTOCOLS
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.results import Study

BASE_TABLE = "base"


@dataclass(frozen=True)
class Comparison:
    """Car-following models compared on the check drivers, and the model chosen for the discovery.

    Attributes:
        priors: Priors of the models; the model of the key `driver` is first.
        found: Predictions of each model.
        gains: Log-likelihood of each checked driver under each model minus that under the first [nats], see `gains_of`.
        choice: The choice of a model.
        n_fitted: Number of drivers that the models were calibrated to.
        base: The calibrated model of the key `driver`; None if another model was chosen, or if it was calibrated to a
            sample of the fitted drivers.
        rivals: Priors of the models that are not significantly less likely than the chosen one, the most likely first;
            without any, that of the second most likely model.
        before: Name of the model that was chosen before effects were found; None if the choice has not changed.
    """

    priors: Sequence[Prior]
    found: Sequence[ModelPredictions]
    gains: Sequence[Float[np.ndarray, " drivers"]]
    choice: Choice
    n_fitted: int
    base: Base | None
    rivals: tuple[Prior, ...]
    before: str | None = None

    @property
    def prior(self) -> Prior:
        """The chosen model."""
        return self.priors[self.choice.chosen]

    @property
    def next_best(self) -> list[Prior]:
        """All models that were not chosen, the most likely first."""
        chosen = self.gains[self.choice.chosen]
        others = [index for index in range(len(self.priors)) if index != self.choice.chosen]
        return [self.priors[k] for k in sorted(others, key=lambda k: -float((self.gains[k] - chosen).sum()))]

    def denies(self, prior: Prior) -> bool:
        """True if simulations of the check drivers contradict a model as a replacement of the chosen one."""
        return self.choice.denies(self.priors.index(prior))

    def with_choice(self, prior: Prior) -> "Comparison":
        """The comparison with another choice; the model chosen before becomes the first rival."""
        others = (other for other in self.rivals if other != prior)
        choice = replace(self.choice, chosen=self.priors.index(prior))
        return replace(self, choice=choice, base=None, rivals=(self.prior, *others), before=self.prior.name)


def comparison_of(
    priors: Sequence[Prior],
    parts: Parts,
    options: DiscoverConfig,
    progress: Callable[[int, int], None],
    study: Study | None = None,
) -> Comparison:
    """Comparison of car-following models on the check drivers; the model of the key `driver` is the first.

    The `study`, if there is one, stores the predictions, so that an interrupted run can continue; `progress` is called
    with the number of models done and of all models.
    """
    fitted = parts.fitted.sample(MOST_FITTED, options.seed)
    checked, base = parts.checked.sample(MOST_CHECKED, options.seed), None
    if study is not None and study.owns(BASE_TABLE):  # stored by an interrupted run
        found = read_compared(study.path / f"{BASE_TABLE}.parquet")
    else:
        solvers = [solver_of(parts.fitted, prior) for prior in priors]
        found, base = compared_models(
            solvers, fitted, checked, options.seed, progress, lane_changes=options.lane_changes
        )
        if study is not None:
            study.write_table(BASE_TABLE, compared_table(found), seeds=f"discover.seed={options.seed}")
    gains = gains_of([predictions.log_likelihood for predictions in found], checked)
    errors = [{name: by_driver["gap_rmse"] for name, by_driver in predictions.errors.items()} for predictions in found]
    choice = choice_of(gains, errors, options.seed)
    if choice.chosen != 0 or fitted is not parts.fitted:
        base = None
    order = sorted(range(len(found)), key=lambda index: -float(gains[index].sum()))
    others = [index for index in order if index != choice.chosen]
    equal = [
        index for index in others if not is_beaten(gains[index], [gains[index], gains[choice.chosen]], options.seed)
    ]
    rivals = tuple(priors[index] for index in equal or others[:1])
    return Comparison(priors, found, gains, choice, fitted.n_drivers, base, rivals)


def base_block(comparison: Comparison, options: DiscoverConfig, time_gaps: dict[str, Any]) -> dict[str, Any]:
    """The entry `base` of the verdict; `time_gaps` are the equilibrium time gaps under the chosen model, as in the
    verdict.
    """
    resampling, choice = Resampling(options.confidence, options.draws, options.seed), comparison.choice
    rows = []
    for index, predictions in enumerate(comparison.found):
        protocols: dict[str, Any] = dict.fromkeys(PROTOCOLS)
        for name, by_driver in predictions.errors.items():
            figures = {
                measure: {
                    statistic: resampling.figure(resampling.drawn(by_driver[measure], pool))
                    for statistic, pool in STATISTICS.items()
                }
                for measure in PROTOCOL_MEASURES
            }
            protocols[name] = {"n_drivers": len(by_driver["gap_rmse"])} | figures
        rows.append(
            {
                "name": predictions.name,
                "n_parameters": comparison.priors[index].size,
                "log_likelihood": resampling.figure(resampling.drawn(predictions.log_likelihood, np.sum)),
                "gain": resampling.figure(resampling.drawn(comparison.gains[index], np.sum)),
                "better_share": choice.better_share[index],
                "best_share": choice.best_share[index],
                "is_vetoed": index in choice.vetoed,
                "protocols": protocols,
            }
        )
    return {
        "chosen": comparison.prior.name,
        "driver": comparison.priors[0].name,
        "before": comparison.before,
        "differs": choice.chosen != 0,
        "compared": rows,
        "drivers": {"fitted": comparison.n_fitted, "checked": len(comparison.found[0].log_likelihood)},
        "equilibrium_time_gap": time_gaps,
    }

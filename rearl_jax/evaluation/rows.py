"""Rows of an evaluation: the traffic of each row, and the main row, which figures and differences refer to.

Methods, the variants of a repaired model, mixtures of driver classes and pairs of thresholds are rows alike.
"""

from dataclasses import dataclass, replace

from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.config import EvaluateTask
from rearl_jax.config.evaluation import Method, Variant
from rearl_jax.evaluation.scores import WITH_EFFECT
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED
from rearl_jax.evaluation.traffic import MODEL_METHODS, is_cooperative, population_of
from rearl_jax.models.population import Population


@dataclass(frozen=True)
class Row:
    """Traffic that is simulated from the initial states of the held-out scenes and scored on them.

    Attributes:
        config: Method, model and all other keys that determine the traffic.
        name: Name in tables and files.
        thresholds: Thresholds of the Hellinger distance and of the spacing error, for methods that intervene.
        mixture: Shares of the driver classes, for method=critical; None for `critical.ratios`.
        drivers: Drivers in place of those of the configuration; None for those of the configuration.
    """

    config: EvaluateTask
    name: str = ""
    thresholds: tuple[float, float] = NEVER_EXCEEDED
    mixture: Mixture | None = None
    drivers: Population | None = None

    @property
    def population(self) -> Population | None:
        """Drivers and effects; None for highway-env's."""
        return population_of(self.config) if self.drivers is None else self.drivers

    @property
    def is_cooperative(self) -> bool:
        """True if any driver may consider what a lane change costs others."""
        return self.drivers is not None or is_cooperative(self.config)


@dataclass(frozen=True)
class Rows:
    """Rows from the same initial states, with the same quantiles of drivers and the same thresholds.

    Attributes:
        rows: In the order of the table.
        main: Name of the row that figures and differences refer to.
        has_variants: Whether the rows are base and rearl, each without and with the effects of a model.
    """

    rows: tuple[Row, ...]
    main: str
    has_variants: bool = False


def compares_variants(config: EvaluateTask) -> bool:
    """True if base and rearl are evaluated without and with the effects of a model."""
    return config.model is not None and config.variant is Variant.all


def rows_of(
    config: EvaluateTask, thresholds: tuple[float, float] = NEVER_EXCEEDED, mixture: Mixture | None = None
) -> Rows:
    """The row of the method and, for methods other than base, a row of base; or the four rows of a repaired model."""
    if compares_variants(config):
        variants = ((Variant.calibrated, ""), (Variant.repaired, WITH_EFFECT))
        rows = (
            Row(replace(config, method=method, variant=variant), f"{method.name}{ending}", thresholds)
            for method in MODEL_METHODS
            for variant, ending in variants
        )
        return Rows(tuple(rows), f"{Method.rearl.name}{WITH_EFFECT}", has_variants=True)
    rows = (Row(config, config.method.name, thresholds, mixture),)
    if config.method is not Method.base:
        rows += (Row(replace(config, method=Method.base), Method.base.name),)
    return Rows(rows, config.method.name)

"""Claims of a discovery: missing effects with parameters and confidence, as entries of verdict.json."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A value with its unit and the bounds of its confidence interval, which are None if the value was not fitted."""

    value: float
    low: float | None
    high: float | None
    unit: str


@dataclass(frozen=True)
class Claim:
    """An effect missing from the model, or a measurement artefact.

    Attributes:
        name: Name of the library effect, of a dependence without a library effect, or of an artefact.
        kind: `driver`, `road`, `artefact`, or `generic` for a dependence without a library effect.
        parameters: Fitted parameters with their units.
        variables: Variables that the effect depends on.
        confidence: Probability that the effect is present [-].
        evidence: Gain of log-likelihood [nats], for lane-choice effects that of drivers who were not fitted; None if
            nothing was fitted.
        depends_on_base: Names of other car-following models under which the effect is not found.
    """

    name: str
    kind: str
    parameters: dict[str, Estimate]
    variables: tuple[str, ...]
    confidence: float
    evidence: float | None
    depends_on_base: tuple[str, ...] = ()

    def plain(self) -> dict[str, Any]:
        """The claim as an entry of `effects` in verdict.json."""
        return asdict(self) | {
            "variables": list(self.variables),
            "depends_on_base": list(self.depends_on_base),
        }


def share_of(total: float, rivals: Sequence[float]) -> float:
    """Posterior probability of an explanation [-] if it, its rivals and "no effect" are equally probable a priori; its
    gain of log-likelihood over no effect is `total`, those of its rivals are `rivals` [nats].
    """
    return 1.0 / (1.0 + float(np.exp(np.clip(np.array([0.0, *rivals]) - total, -50, 50)).sum()))

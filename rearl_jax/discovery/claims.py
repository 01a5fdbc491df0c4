"""Claims of a discovery: what it says is missing, with numbers and how sure it is, as entries of verdict.json."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A number with its interval; the ends are None where it was not searched."""

    value: float
    low: float | None
    high: float | None
    unit: str


@dataclass(frozen=True)
class Claim:
    """Something that is missing from the model, or an artefact of the measurement.

    Attributes:
        name: Name of the effect in the library, of a dependence without a name, or of an artefact.
        kind: `driver`, `road`, `generic` for a dependence without a name, `artefact`.
        parameters: In its units.
        variables: What it depends on.
        confidence: Probability that it is there [-].
        evidence: Log-likelihood it adds [nats], of an effect on the choice of the lane on drivers it was not fitted to;
            None where nothing was fitted.
        depends_on_base: Names of other car-following models under which it does not hold.
    """

    name: str
    kind: str
    parameters: dict[str, Estimate]
    variables: tuple[str, ...]
    confidence: float
    evidence: float | None
    depends_on_base: tuple[str, ...] = ()

    def plain(self) -> dict[str, Any]:
        """As an entry of `effects` in verdict.json."""
        return asdict(self) | {
            "variables": list(self.variables),
            "depends_on_base": list(self.depends_on_base),
        }


def share_of(total: float, rivals: Sequence[float]) -> float:
    """Probability of an account among its rivals, and that nothing is there, by their log-likelihoods [nats]."""
    return 1.0 / (1.0 + float(np.exp(np.clip(np.array([0.0, *rivals]) - total, -50, 50)).sum()))

"""Findings on lane changing, as entries of a verdict."""

from dataclasses import asdict, dataclass
from typing import Any

from rearl_jax.discovery.claims import Claim, Estimate
from rearl_jax.discovery.lane_changes.prediction import Prediction


@dataclass(frozen=True)
class RankedCandidate:
    """Test results of a candidate before any effect was added.

    Attributes:
        name, kind, variables: As in `LaneCandidate`.
        z_score: Slope of the likelihood along the candidate, in standard deviations between drivers [-].
        gain: Gain of log-likelihood on the fitted drivers [nats]; None if it was not fitted.
        check: Gain of log-likelihood on drivers that it was not fitted to [nats]; None if it was not fitted.
        ambiguous: Whether it explains the changes about as well as the named effect.
    """

    name: str
    kind: str
    variables: tuple[str, ...]
    z_score: float
    gain: float | None
    check: float | None
    ambiguous: bool

    def plain(self) -> dict[str, Any]:
        """The candidate as an entry of `candidates` in verdict.json."""
        return {
            "name": self.name,
            "kind": self.kind,
            "variables": list(self.variables),
            "evidence": 0.5 * self.z_score**2,
            "z_score": self.z_score,
            "gain": self.gain,
            "check": self.check,
            "ambiguous": self.ambiguous,
            "told_apart_by": "changes in which the two would choose differently" if self.ambiguous else None,
        }


@dataclass(frozen=True)
class Loss:
    """Mean log-loss before and after effects were added, and its change with an interval [nats]."""

    before: float
    after: float
    change: Estimate


@dataclass(frozen=True)
class LaneChangeFindings:
    """Findings in lane changing.

    Attributes:
        n_changes, n_opportunities: Usable lane changes and opportunities in the data.
        words: Summary in one line, or the reason why nothing could be tested.
        effects: Claimed effects, in the order in which they were added.
        candidates: All candidates, the largest z-score first.
        loss: Mean log-loss per opportunity of the held-out drivers without and with the effects [nats]; None if nothing
            could be tested.
        prediction: Predicted lane changes of the held-out drivers; None if there are too few changes.
    """

    n_changes: int
    n_opportunities: int
    words: str
    effects: tuple[Claim, ...] = ()
    candidates: tuple[RankedCandidate, ...] = ()
    loss: Loss | None = None
    prediction: Prediction | None = None

    def as_verdict_parts(self) -> dict[str, Any]:
        """Entries for `effects` and `candidates` of verdict.json, and its `lane_choice`."""
        loss = None if self.loss is None else asdict(self.loss)
        return {
            "effects": [effect.plain() for effect in self.effects],
            "candidates": [candidate.plain() for candidate in self.candidates],
            "lane_choice": {"changes": self.n_changes, "opportunities": self.n_opportunities, "loss": loss},
        }

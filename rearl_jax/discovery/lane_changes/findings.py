"""Findings on lane changing, as entries of a verdict."""

from dataclasses import asdict, dataclass
from typing import Any

from rearl_jax.discovery.claims import Claim, Estimate
from rearl_jax.discovery.lane_changes.prediction import Prediction


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
        candidates: All candidates before any effect was added, as entries of `candidates` in verdict.json: the largest
            z-score first.
        loss: Mean log-loss per opportunity of the held-out drivers without and with the effects [nats]; None if nothing
            could be tested.
        prediction: Predicted lane changes of the held-out drivers; None if there are too few changes.
    """

    n_changes: int
    n_opportunities: int
    words: str
    effects: tuple[Claim, ...] = ()
    candidates: tuple[dict[str, Any], ...] = ()
    loss: Loss | None = None
    prediction: Prediction | None = None

    def as_verdict_parts(self) -> dict[str, Any]:
        """Entries for `effects` and `candidates` of verdict.json, and its `lane_choice`."""
        loss = None if self.loss is None else asdict(self.loss)
        return {
            "effects": [effect.plain() for effect in self.effects],
            "candidates": list(self.candidates),
            "lane_choice": {"changes": self.n_changes, "opportunities": self.n_opportunities, "loss": loss},
        }

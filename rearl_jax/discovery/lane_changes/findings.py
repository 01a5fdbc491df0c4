"""Findings in lane changing, as they go into a verdict."""

from dataclasses import asdict, dataclass
from typing import Any

from rearl_jax.discovery.claims import Claim, Estimate
from rearl_jax.discovery.lane_changes.prediction import Prediction


@dataclass(frozen=True)
class RankedCandidate:
    """A candidate as it was seen before anything was added.

    Attributes:
        name, kind, variables: What it is.
        z_score: Slope of its likelihood, in standard deviations between drivers [-].
        gain: Log-likelihood it adds on the drivers it is fitted to [nats]; None where it was not fitted.
        check: The same on drivers it was not fitted to [nats].
        ambiguous: Whether it explains the changes about as well as what was named.
    """

    name: str
    kind: str
    variables: tuple[str, ...]
    z_score: float
    gain: float | None
    check: float | None
    ambiguous: bool

    def plain(self) -> dict[str, Any]:
        """As an entry of `candidates` in verdict.json."""
        return {
            "name": self.name,
            "kind": self.kind,
            "variables": list(self.variables),
            "evidence": 0.5 * self.z_score**2,
            "surprise": self.z_score,
            "gain": self.gain,
            "check": self.check,
            "ambiguous": self.ambiguous,
            "told_apart_by": "changes in which the two would choose differently" if self.ambiguous else None,
        }


@dataclass(frozen=True)
class LaneChangeFindings:
    """Findings in lane changing.

    Attributes:
        effects: What is claimed, in the order in which it was found.
        candidates: All that was looked for, the most surprising first.
        n_changes, n_opportunities: In the data, as far as they could be used.
        loss_before, loss_after: Mean log-loss of an opportunity of drivers nothing was fitted to [nats]; None where
            there were too few changes.
        loss_change: After less before, with its interval.
        words: One line for a reader; why nothing could be seen, where nothing could.
        prediction: Chances that models give the changes of the report drivers; None where there are too few changes.
    """

    effects: tuple[Claim, ...]
    candidates: tuple[RankedCandidate, ...]
    n_changes: int
    n_opportunities: int
    loss_before: float | None
    loss_after: float | None
    loss_change: Estimate | None
    words: str
    prediction: Prediction | None = None

    def as_verdict_parts(self) -> dict[str, Any]:
        """Entries for `effects` and `candidates` of verdict.json, and its `lane_choice`."""
        loss = None
        if self.loss_change is not None:
            loss = {"before": self.loss_before, "after": self.loss_after, "change": asdict(self.loss_change)}
        return {
            "effects": [effect.plain() for effect in self.effects],
            "candidates": [candidate.plain() for candidate in self.candidates],
            "lane_choice": {"changes": self.n_changes, "opportunities": self.n_opportunities, "loss": loss},
        }


def nothing_seen(n_changes: int, n_opportunities: int, words: str) -> LaneChangeFindings:
    """Where there is too little to look at."""
    return LaneChangeFindings((), (), n_changes, n_opportunities, None, None, None, words)

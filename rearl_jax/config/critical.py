"""Configuration of the baseline CRITICAL: source of the shares of driver classes, and their evaluation."""

import math
from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least
from rearl_jax.problems import out_of_range


class Proposer(Enum):
    """Source of the shares of aggressive and defensive drivers and of trucks."""

    stats = "stats"
    """The recordings: the shares among the vehicles of the threshold scenes, the part of the scenes that thresholds of
    detection are computed from.
    """
    llm = "llm"
    """A language model that receives the results of earlier rounds; decision.server names its server."""
    search = "search"
    """A grid: all its points are simulated, and the best one is selected."""


@dataclass(unsafe_hash=True)
class CriticalConfig:
    """Shares of the driver classes of method=critical"""

    proposer: Proposer = key(
        Proposer.stats, "stats: as in the recordings; llm: a language model (CRITICAL); search: a grid"
    )
    rounds: int = key(5, "rounds of proposer=llm, each a new proposal of shares and its simulation")
    rollouts: int = key(16, "rollouts per round or grid point, from initial states that no evaluation uses")
    attempts: int = key(
        5, "invalid answers of a language model per round before the shares stay as they are (CRITICAL)"
    )
    history: int = key(5, "past rounds shown to the language model (CRITICAL)")
    max_tokens: int = key(256, "limit of an answer's length [tokens]; the larger of this and llm.max_tokens applies")
    ratios: tuple[float, float, float] | None = key(
        None, "fixed shares [aggressive, defensive, truck], the rest is regular; null = chosen by the proposer"
    )

    def check(self) -> None:
        check_least(self, 1, "rounds", "rollouts", "attempts", "max_tokens")
        check_least(self, 0, "history")
        if self.ratios is not None and (problem := shares_problem(self.ratios)):
            message = f"must be three shares with a sum of at most 1 ({problem})"
            raise out_of_range("ratios", message, list(self.ratios))


def shares_problem(shares: tuple[float, ...]) -> str:
    """Problem of shares that must sum to at most 1; empty if there is none."""
    for share in shares:
        if not (math.isfinite(share) and 0 <= share <= 1):
            return f"{share:g} is not within 0 and 1"
    total = sum(shares)
    return "" if total <= 1 + 1e-9 else f"their sum is {total:g}"

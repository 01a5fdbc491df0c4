"""Configuration of the detection of simulated traffic that differs too much from its reference.

Defaults marked "REARL" are stated in the paper (Bi et al.). Base is the traffic without corrections, method=base.
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_within
from rearl_jax.problems import out_of_range


class Cues(Enum):
    """Measure that triggers a decision."""

    both = "both"
    """Hellinger distance or spacing error above its threshold."""
    speed = "speed"
    """Hellinger distance alone."""
    spacing = "spacing"
    """Spacing error alone."""
    always = "always"
    """Every detection triggers."""
    never = "never"
    """No detection triggers: the traffic is that of method=base."""


class Scope(Enum):
    """Vehicles of a triggered scenario that need a decision."""

    scene = "scene"
    """All."""
    vehicle = "vehicle"
    """Vehicles that contribute to the deviation."""


class ReferenceMode(Enum):
    """Representative scene that a rollout is compared with."""

    spacing = "spacing"
    """The one with the smallest error of the mean spacing, averaged over all frames so far."""
    spacing_speed = "spacing_speed"
    """The one with the smallest weighted sum of that error and the Hellinger distance of all speeds so far."""
    drawn = "drawn"
    """One for the whole rollout, drawn in proportion to the size of its cluster."""


@dataclass(unsafe_hash=True)
class DetectionConfig:
    """Detection of traffic that needs corrections"""

    threshold_h: float | None = key(
        None, "threshold of the Hellinger distance of speeds [-]; null = the percentile h_pct of base"
    )
    threshold_m: float | None = key(
        None, "threshold of the spacing error [-], see mape.definition; null = the percentile m_pct of base"
    )
    h_pct: float = key(30.0, "percentile of base's Hellinger distances on the threshold scenes [%]; REARL")
    m_pct: float = key(5.0, "percentile of base's spacing errors on the threshold scenes [%]; REARL")
    cues: Cues = key(Cues.both, "measure that triggers: both (either one; REARL), speed, spacing, always, never")
    interval: int = key(1, "time between two detections [s]; REARL: every step")
    scope: Scope = key(Scope.scene, "vehicles that need a decision: scene = all, vehicle = those that contribute")

    def check(self) -> None:
        check_least(self, 0, "threshold_h", "threshold_m")
        check_within(self, 0, 100, "h_pct", "m_pct")
        check_least(self, 1, "interval")


@dataclass(unsafe_hash=True)
class ReferenceConfig:
    """Choice of the representative scene that a rollout is compared with"""

    mode: ReferenceMode = key(
        ReferenceMode.spacing,
        "spacing (can stay at a congested reference) or spacing_speed, both described by REARL; drawn: one per "
        "rollout, in proportion to the scenes it represents",
    )
    weights: tuple[float, float] = key((1.0, 1.0), "weights of spacing error and Hellinger distance for spacing_speed")

    def check(self) -> None:
        if min(self.weights) < 0 or sum(self.weights) == 0:
            raise out_of_range("weights", "must be >= 0 and not both 0", self.weights)
        check_finite(self, "weights")

"""Configuration of the detection: when simulated traffic has drifted too far from its reference.

Defaults marked "REARL" are stated in the paper (Bi et al.); "own choice" resolves something it leaves open.
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


class Cues(Enum):
    """What triggers a decision."""

    both = "both"
    """Hellinger distance or spacing error above its threshold."""
    speed = "speed"
    """Hellinger distance alone."""
    spacing = "spacing"
    """Spacing error alone."""
    always = "always"
    """Every time the detection is due."""
    never = "never"
    """Nothing: the traffic is that of the method base."""


class Scope(Enum):
    """Which vehicles of a triggered scenario need a decision."""

    scene = "scene"
    """All."""
    vehicle = "vehicle"
    """Those that contribute to what is exceeded."""


class ReferenceMode(Enum):
    """Which representative scene a rollout is held against."""

    spacing = "spacing"
    """The one of least error of the mean spacing, averaged over all frames so far."""
    spacing_speed = "spacing_speed"
    """The same with the Hellinger distance of all speeds so far added."""
    drawn = "drawn"
    """One for the whole rollout, drawn with the share of the fitted scenes that its cluster holds."""


@dataclass(unsafe_hash=True)
class DetectionConfig:
    """Detection of traffic that needs decisions"""

    threshold_h: float | None = key(
        None, "Hellinger distance above which the speeds trigger [-]; null = the percentile h_pct of base"
    )
    threshold_m: float | None = key(
        None, "spacing error above which the spacing triggers [-], see mape.definition; null = the percentile m_pct"
    )
    h_pct: float = key(30.0, "percentile of base's Hellinger distances on the threshold scenes [%]; REARL")
    m_pct: float = key(5.0, "percentile of base's spacing errors on the threshold scenes [%]; REARL")
    cues: Cues = key(Cues.both, "both (either one, REARL), speed, spacing, always, never")
    interval: int = key(1, "time between two detections [s]; 1 (REARL: every step), 5 asks less often")
    scope: Scope = key(
        Scope.scene, "vehicles that need a decision: scene = all (own choice), vehicle = contributing ones"
    )

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        for name in ("threshold_h", "threshold_m"):
            value = getattr(self, name)
            if value is not None and not value >= 0:
                raise out_of_range(name, "must be >= 0 or null", value)
        for name in ("h_pct", "m_pct"):
            if not 0 <= getattr(self, name) <= 100:
                raise out_of_range(name, "must be within 0 and 100 %", getattr(self, name))
        if self.interval < 1:
            raise out_of_range("interval", "must be at least 1 s", self.interval)


@dataclass(unsafe_hash=True)
class ReferenceConfig:
    """Choice of the representative scene a rollout is held against"""

    mode: ReferenceMode = key(
        ReferenceMode.spacing,
        "spacing (can lock on to a congested reference), spacing_speed: REARL describes both; "
        "drawn: one per rollout, by the share of scenes (own choice)",
    )
    weights: tuple[float, float] = key(
        (1.0, 1.0), "of spacing error and Hellinger distance in spacing_speed; own choice"
    )

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if min(self.weights) < 0 or sum(self.weights) == 0:
            raise out_of_range("weights", "must be >= 0 and not both 0", self.weights)

"""Configuration of the metrics: histograms, spacing errors, headways, safety and realism."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_positive
from rearl_jax.config.scenes import SpacingConfig
from rearl_jax.problems import out_of_range


class OutOfBounds(Enum):
    """Treatment of speeds outside the range of the histogram."""

    clip = "clip"
    drop = "drop"


class MapeDefinition(Enum):
    """Definition of the relative error of the mean spacing; all three are always written."""

    A = "A"
    B = "B"
    C = "C"


class Gap(Enum):
    """Distance in the numerator of the time headway."""

    bumper = "bumper"
    centre = "centre"


class SpeedValues(Enum):
    """Speeds compared by the realism of speed."""

    scaled = "scaled"
    raw = "raw"


@dataclass(unsafe_hash=True)
class HistConfig:
    """Speed histogram of the Hellinger distance"""

    low: float = key(5.0, "lower edge of the first bin [m/s]; REARL, the lowest target speed of DiLu")
    high: float = key(32.0, "upper edge of the last bin [m/s]; REARL, the highest target speed of DiLu")
    n_bins: int = key(8, "number of equal bins; REARL")
    window: int = key(5, "length of the sliding window [frames at 1 Hz = s]; REARL")
    oob: OutOfBounds = key(OutOfBounds.clip, "speeds outside the range: clip (into the outer bins) or drop")

    def check(self) -> None:
        if not self.high > self.low:
            raise out_of_range("high", f"must exceed low ({self.low})", self.high)
        check_finite(self, "low", "high")
        check_least(self, 1, "n_bins", "window")


@dataclass(unsafe_hash=True)
class MapeConfig:
    """Relative error of the mean spacing that detection and selection use"""

    definition: MapeDefinition = key(
        MapeDefinition.A,
        "A: |sim - real| / sim (REARL, Eq. 8), B: |sim - real| / real, C: mean_j |real_j - sim| / real, with the mean "
        "spacings sim and real of a frame, simulated and recorded, and real_j that of recorded vehicle j",
    )

    @property
    def column(self) -> str:
        """Name of this error among the metrics and in the tables: `mape_a`, `mape_b` or `mape_c`."""
        return f"mape_{self.definition.name.lower()}"


@dataclass(unsafe_hash=True)
class ThwConfig:
    """Time headway of same-lane leader-follower pairs"""

    gap: Gap = key(Gap.bumper, "distance of the headway: bumper to bumper or centre to centre")
    v_min: float = key(1.0, "smallest speed of a follower [m/s], which keeps the ratio finite")

    def check(self) -> None:
        if not self.v_min > 0:
            raise out_of_range("v_min", "must be > 0 m/s (a headway divides by the speed)", self.v_min)


@dataclass(unsafe_hash=True)
class SafetyConfig:
    """Thresholds of the surrogate safety measures"""

    ttc: float = key(1.5, "critical time to collision [s]; FHWA-HRT-08-051 (SSAM, Gettman et al. 2008)")
    drac: float = key(3.35, "critical deceleration to avoid a crash [m/s^2], positive; Archer (2005), KTH")
    jerk: float = key(2.5, "magnitude of a large jerk, mean over 1 s [m/s^3]; ISO 15622:2018, limit above 20 m/s")

    def check(self) -> None:
        check_positive(self, "ttc", "drac", "jerk")


@dataclass(unsafe_hash=True)
class FeatureConfig:
    """Histogram of one realism feature"""

    low: float = key(0.0, "lower edge; smaller values count in the first bin")
    high: float = key(1.0, "upper edge; larger values count in the last bin")
    n_bins: int = key(10, "number of equal bins")
    weight: float = key(0.0, "weight before normalisation over the features used [-]")

    def check(self) -> None:
        if not self.high > self.low:
            raise out_of_range("high", f"must exceed low ({self.low})", self.high)
        check_finite(self, "low", "high", "weight")
        check_least(self, 1, "n_bins")
        check_least(self, 0, "weight")


@dataclass(unsafe_hash=True)
class RealismConfig:
    """Highway subset of the Waymo Open Sim Agents realism measures"""

    speed_values: SpeedValues = key(SpeedValues.scaled, "scaled (as in the Hellinger distance) or raw")
    speed: FeatureConfig = key(
        lambda: FeatureConfig(low=0.0, high=35.0, n_bins=10, weight=0.05),
        "linear speed [m/s]; range of the 2023 challenge (later ones stop at 25 m/s), weight of 2024",
    )
    acceleration: FeatureConfig = key(
        lambda: FeatureConfig(low=-12.0, high=12.0, n_bins=11, weight=0.05),
        "linear acceleration [m/s^2]; Waymo Sim Agents challenge 2024",
    )
    distance: FeatureConfig = key(
        lambda: FeatureConfig(low=-5.0, high=40.0, n_bins=10, weight=0.1),
        "signed distance to the nearest object [m]; Waymo Sim Agents challenge 2024",
    )
    ttc: FeatureConfig = key(
        lambda: FeatureConfig(low=0.0, high=5.0, n_bins=10, weight=0.1),
        "time to collision [s], capped at the upper edge; Waymo Sim Agents challenge 2024",
    )
    headway: FeatureConfig = key(
        lambda: FeatureConfig(low=0.0, high=10.0, n_bins=20, weight=0.0),
        "time headway [s] of the pairs of thw; bins as wide as those of the time to collision; weight 0, because the "
        "challenge does not have this feature",
    )
    collision_weight: float = key(0.25, "weight of the collision indicator; Waymo Sim Agents challenge 2024")
    pseudocount: float = key(0.1, "additive smoothing per bin; Waymo Sim Agents challenge 2024")
    collision_pseudocount: float = key(0.001, "additive smoothing of the collision indicator; same source")

    def check(self) -> None:
        for name in ("pseudocount", "collision_pseudocount"):
            if not getattr(self, name) > 0:
                raise out_of_range(name, "must be > 0 (an empty bin needs a probability)", getattr(self, name))
        check_finite(self, "pseudocount", "collision_pseudocount", "collision_weight")
        check_least(self, 0, "collision_weight")
        features = (self.speed, self.acceleration, self.distance, self.ttc, self.headway)
        if not self.collision_weight + sum(feature.weight for feature in features) > 0:
            message = "must be > 0 if the weights of the features are all 0"
            raise out_of_range("collision_weight", message, self.collision_weight)


@dataclass(unsafe_hash=True)
class MetricsConfig:
    """Settings of all metrics of a scene"""

    hist: HistConfig = key(HistConfig, "speed histogram")
    thw: ThwConfig = key(ThwConfig, "time headway")
    safety: SafetyConfig = key(SafetyConfig, "surrogate safety thresholds")
    realism: RealismConfig = key(RealismConfig, "realism features")
    spacing: SpacingConfig = key(SpacingConfig, "distance between two vehicles")
    frame_interval: float = key(1.0, "time between two frames [s]; REARL")

    def check(self) -> None:
        check_positive(self, "frame_interval")

"""Configuration of scenes: windows, vehicles, speeds, distances, splits.

Defaults marked "REARL" are those of the paper (Bi et al.).
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_positive
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


class Direction(Enum):
    """Carriageways of a scene."""

    pooled = "pooled"
    """Both carriageways together: a 2 + 2-lane motorway is one scene."""
    per_direction = "per_direction"
    """Every carriageway is a scene of its own."""


class Pick(Enum):
    """Duration by which a vehicle of a snapshot counts as recorded longest."""

    elapsed = "elapsed"
    """Time since the vehicle entered the recording, at that frame."""
    total_duration = "total_duration"
    """Length of the vehicle's whole track."""


class SpeedNorm(Enum):
    """Rescaling of recorded speeds to the simulator's range of 5 to 32 m/s."""

    minmax = "minmax"
    """Affine; the extremes of all accepted scenes become 5 and 32 m/s."""
    minmax_p01_999 = "minmax_p01_999"
    """Affine; the 0.1 and 99.9 percentiles become 5 and 32 m/s, values outside are clipped."""
    clip = "clip"
    """Recorded speed, clipped to the range."""
    none = "none"
    """Recorded speed."""


class FeatureDistance(Enum):
    """The distance d in the feature vector (v, x, d) of a vehicle."""

    mean_all = "mean_all"
    """Mean distance to all other vehicles present [m]."""
    dhw = "dhw"
    """Bumper-to-bumper distance to the vehicle ahead in the same lane [m]; 0 if there is none."""


class SpacingMetric(Enum):
    """Distance between the centres of two vehicles."""

    euclid2d = "euclid2d"
    """Euclidean in the ground plane."""
    longitudinal = "longitudinal"
    """Along the road only."""


class BoundarySource(Enum):
    """Recorded vehicles that are replayed around the simulated ones."""

    free = "free"
    """None: the foremost vehicle of a lane has a free road."""
    leaders = "leaders"
    """On each lane the vehicle ahead of the foremost simulated one."""
    measured = "measured"
    """All recorded vehicles that are not simulated."""


class SplitUnit(Enum):
    """Unit that is assigned to a split as a whole."""

    scenario = "scenario"
    """One window; refused if windows overlap."""
    recording = "recording"
    """One recording."""
    block = "block"
    """One contiguous stretch of time of one recording."""


@dataclass(unsafe_hash=True)
class ScenesConfig:
    """Windows of the recordings that become scenes"""

    direction: Direction = key(Direction.pooled, "vehicles of both carriageways together (pooled) or per_direction")
    seconds: int = key(60, "length of a scene [s] = number of 1 Hz snapshots; REARL")
    min_vehicles: int = key(10, "smallest number of vehicles in every snapshot of a scene; REARL")
    slots: int = key(10, "vehicles used in every snapshot, those recorded longest; REARL")
    pick: Pick = key(Pick.elapsed, "recorded longest by time since entry (elapsed) or by total_duration")
    stride: float | None = key(None, "time between two window starts [s]; null = scenes.seconds, no overlap")

    boundary: BoundarySource = key(
        BoundarySource.free,
        "recorded vehicles replayed around the simulated ones: free = none (REARL), leaders = the one ahead of the "
        "foremost on each lane, measured = all others; leaders and measured need init.source=scene",
    )

    @property
    def stride_seconds(self) -> float:
        """Time between two window starts [s]."""
        return float(self.seconds if self.stride is None else self.stride)

    def check(self) -> None:
        check_least(self, 2, "seconds")
        if self.slots < 2:
            raise out_of_range("slots", "must be at least 2 (a spacing needs two vehicles)", self.slots)
        if self.min_vehicles < self.slots:
            raise out_of_range("min_vehicles", f"must be at least slots = {self.slots}", self.min_vehicles)
        check_positive(self, "stride")
        check_finite(self, "stride")

    def require_free(self) -> None:
        """Raise InvalidInputError for a boundary in a task that simulates nothing."""
        if self.boundary is not BoundarySource.free:
            message = "has no effect where nothing is simulated: leave it out, or use `rearl evaluate`"
            problem = Problem("nothing-simulated", message, key="scenes.boundary", value=self.boundary.name)
            raise InvalidInputError(problem)


@dataclass(unsafe_hash=True)
class SpeedConfig:
    """Rescaling of recorded speeds to the simulator's range"""

    norm: SpeedNorm = key(
        SpeedNorm.none,
        "none: as recorded; minmax: rescaled to 5 to 32 m/s (REARL, with init.source=seed); minmax_p01_999: the same "
        "by the 0.1 and 99.9 percentiles; clip: cut to that range",
    )


@dataclass(unsafe_hash=True)
class TracksConfig:
    """Tracks that are long enough for trajectory features"""

    min_frames: int = key(100, "shortest track [frames of the recording], 4 s at 25 Hz; REARL")
    points: int = key(64, "points of a track's feature curve, evenly spaced in time")

    def check(self) -> None:
        check_least(self, 2, "min_frames", "points")


@dataclass(unsafe_hash=True)
class FeaturesConfig:
    """Feature vector (v, x, d) of a vehicle"""

    d: FeatureDistance = key(
        FeatureDistance.mean_all,
        "distance d [m]: mean_all = mean distance to all others, dhw = gap to the vehicle ahead",
    )


@dataclass(unsafe_hash=True)
class SpacingConfig:
    """Distance between two vehicles"""

    metric: SpacingMetric = key(SpacingMetric.euclid2d, "euclid2d or longitudinal, centre to centre")


@dataclass(unsafe_hash=True)
class SplitConfig:
    """Threshold, tuning and evaluation scenes"""

    unit: SplitUnit = key(SplitUnit.scenario, "unit assigned as a whole: scenario (REARL), recording, block")
    seed: int = key(0, "seed of the random assignment")
    block_seconds: float = key(300.0, "length of a block [s], for split.unit=block")
    threshold: int | None = key(
        None, "number of scenes for the thresholds of the detector; null = 150 if there are 741 (REARL), else a fifth"
    )
    tuning: int | None = key(
        None, "number of tuning scenes; null = 15 if there are 741 (REARL), else in proportion, 5 to 15"
    )
    evaluation: int | None = key(
        None, "number of evaluation scenes; null = 50 if there are 741 (REARL), else in proportion, 5 to 50"
    )

    def check(self) -> None:
        check_least(self, 0, "seed")
        check_positive(self, "block_seconds")
        check_least(self, 1, "threshold", "tuning", "evaluation")

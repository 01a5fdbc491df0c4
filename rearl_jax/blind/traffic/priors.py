"""Broad priors: what is drawn for every data set of a study with `blind.priors=broad`, and from which range.

The ranges are wide enough for motorways, cities, people and adaptive cruise controls. No range is centred on a value
that discovery assumes, which a test checks.
"""

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace

import numpy as np


@dataclass(frozen=True)
class Range:
    """A uniform prior of a quantity or of its logarithm.

    Attributes:
        low, high: Bounds.
        unit: Unit; "-" for none.
        meaning: What is drawn.
        is_log: Whether the logarithm is uniform.
    """

    low: float
    high: float
    unit: str
    meaning: str
    is_log: bool = True

    @property
    def centre(self) -> float:
        """Centre of the range, the geometric one of a logarithmic range."""
        return math.sqrt(self.low * self.high) if self.is_log else 0.5 * (self.low + self.high)

    def draw(self, rng: np.random.Generator) -> float:
        """A value."""
        if self.is_log:
            return float(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))
        return float(rng.uniform(self.low, self.high))

    def widened(self, factor: float) -> "Range":
        """The range with the same centre and the width times a factor; shares stay within 0 and 1."""
        if self.is_log:
            return replace(
                self, low=self.centre * (self.low / self.centre) ** factor,
                high=self.centre * (self.high / self.centre) ** factor,
            )  # fmt: skip
        half = 0.5 * factor * (self.high - self.low)
        return replace(self, low=max(0.0, self.centre - half), high=min(1.0, self.centre + half))


@dataclass(frozen=True)
class Priors:
    """Priors of everything that differs between data sets, except the hidden effect.

    Medians and standard deviations of drivers' parameters are drawn independently of each other. The correlation matrix
    is drawn from an inverse Wishart distribution with one degree of freedom more than parameters, whose correlations
    are uniform (Barnard, McCulloch & Meng, Statistica Sinica 10 (2000) 1281), and multiplied by `correlation`. The
    car-following model is uniform over the seven of the generator and, where SUMO has the hidden effect itself or
    nothing is hidden, SUMO; the model of SUMO is uniform over five.
    """

    desired_speed: Range = Range(18.0, 40.0, "m/s", "median over cars")
    time_gap: Range = Range(0.8, 3.4, "s", "median over cars")
    jam_gap: Range = Range(1.5, 7.5, "m", "median over cars")
    max_accel: Range = Range(0.5, 2.5, "m/s^2", "median over cars; all models but two")
    comfort_decel: Range = Range(1.0, 6.0, "m/s^2", "median over cars; both IDM, Gipps, Krauss, SUMO")
    accel_exponent: Range = Range(1.5, 6.0, "-", "median over cars; highway-env's IDM")
    gap_exponent: Range = Range(1.2, 5.0, "-", "median over cars; IDM with a separate approach-rate gain")
    gap_gain: Range = Range(0.04, 0.6, "1/s^2", "median over cars; constant time headway")
    approach_gain: Range = Range(0.1, 1.2, "1/s", "median over cars; approach-rate gain, constant time headway, FVDM")
    speed_gain: Range = Range(0.1, 0.9, "1/s", "median over cars; approach-rate gain, constant time headway, FVDM")
    parameter_spread: Range = Range(0.08, 0.4, "-", "standard deviation of the logarithm between drivers, of each")
    correlation: Range = Range(0.0, 0.7, "-", "bound of correlations between parameters", is_log=False)
    truck_share: Range = Range(0.0, 0.35, "-", "share of trucks among followers", is_log=False)
    truck_speed: Range = Range(0.65, 0.95, "-", "desired speed of trucks over that of cars")
    truck_time_gap: Range = Range(0.9, 1.6, "-", "time gap of trucks over that of cars")
    truck_accel: Range = Range(0.4, 0.9, "-", "maximum acceleration of trucks over that of cars")
    driver_noise: Range = Range(0.03, 0.4, "m/s^2", "random acceleration, standard deviation of the median driver")
    driver_noise_time: Range = Range(0.4, 8.0, "s", "its correlation time")
    noise_spread: Range = Range(0.0, 0.4, "-", "standard deviation of the logarithm of its size", is_log=False)
    noise_growth: Range = Range(0.0, 0.5, "s^2/m", "its growth with the driver's own acceleration", is_log=False)
    position_noise: Range = Range(0.03, 0.5, "m", "standard deviation of measured positions")
    noise_time: Range = Range(0.1, 1.5, "s", "correlation time of their errors, in half of the data sets; else white")
    kernel_time: Range = Range(0.1, 0.8, "s", "standard deviation of the smoothing kernel, in half of the data sets")
    slope_time: Range = Range(0.3, 2.0, "s", "window of the speed from positions, in half of the data sets")
    sensor_noise: Range = Range(0.02, 0.3, "m/s", "standard deviation of the speed sensor, in the other half")
    change_time: Range = Range(2.5, 7.0, "s", "time of the sideways motion of a lane change")
    pace: Range = Range(0.4, 1.1, "-", "speed of platoon leaders over that of the usual traffic, per desired speed")
    spacing: Range = Range(0.7, 1.8, "-", "gaps at the start over equilibrium gaps")
    lane_changes: Range = Range(0.05, 2.0, "1/min", "lane changes per follower")
    followers: Range = Range(24.0, 72.0, "-", "followers in three recordings")
    duration: Range = Range(40.0, 160.0, "s", "recorded time")

    def widened(self, factor: float) -> "Priors":
        """These priors with ranges wider by a factor, logarithmic ones in the logarithm."""
        if factor == 1.0:
            return self  # without rounding
        return Priors(**{item.name: getattr(self, item.name).widened(factor) for item in fields(self)})

    def rows(self) -> Iterator[dict]:
        """One row per prior."""
        for item in fields(self):
            prior = getattr(self, item.name)
            yield {"name": item.name, **asdict(prior), "centre": prior.centre}

    def fingerprint(self) -> str:
        """Hash of all ranges and choices."""
        content = json.dumps([*self.rows(), CHOICES], sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:16]


CHOICES = {
    "shape": ("normal", "uniform", "heavy_tails"),
    "kernel": ("gaussian", "moving_average", "triangular", "exponential"),
    "speed": ("positions", "sensor"),
    "lane": ("marking", "decision"),
    "n_lanes": (2, 3, 4),
    "frame_rate": (5.0, 10.0, 25.0),
}
"""Equally likely alternatives, by name: distribution of the drivers' parameters, kernel, speed column, lane column,
number of lanes, frame rate [1/s] (not the last one with SUMO).
"""

PRIORS = Priors()
"""The priors of `blind.width=1`."""

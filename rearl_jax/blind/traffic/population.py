"""Populations of drivers: distribution of every parameter over the drivers of a data set."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

CARS = {
    "desired_speed": (32.0, 0.12),
    "time_gap": (1.25, 0.30),
    "jam_gap": (2.5, 0.30),
    "max_accel": (1.4, 0.30),
    "comfort_decel": (2.0, 0.35),
}
"""Median over cars in SI units, and standard deviation of the logarithm [-].

Source: values and spreads as in calibrations on motorway trajectories (Kesting & Treiber, Transp. Res. Rec. 2088 (2008)
148).
"""

TRUCKS = CARS | {"desired_speed": (25.0, 0.06), "time_gap": (1.6, 0.25), "max_accel": (0.9, 0.20)}
"""The same for trucks."""

TRUCK_SHARE = 0.15
"""Share of trucks among the drivers [-]."""

BOUNDS = {
    "desired_speed": (18.0, 50.0),
    "time_gap": (0.5, 3.0),
    "jam_gap": (1.0, 6.0),
    "max_accel": (0.5, 3.0),
    "comfort_decel": (0.8, 5.0),
}
"""Lowest and highest value of a driver's parameters, in SI units."""


@dataclass(frozen=True)
class DriverParameter:
    """One parameter of the drivers.

    Attributes:
        name: Name of the parameter.
        median, sd: Median over cars, and standard deviation of the logarithm [-].
        truck_median, truck_sd: The same for trucks.
        low, high: Bounds.
    """

    name: str
    median: float
    sd: float
    truck_median: float
    truck_sd: float
    low: float
    high: float


@dataclass(frozen=True)
class Population:
    """The drivers of a data set.

    Attributes:
        parameters: Parameters of the drivers.
        truck_share: Share of trucks among followers [-].
        correlation: Correlation matrix of the normal scores of the parameters; None if they are independent.
        shape: Distribution of the logarithm of a parameter: "normal", "uniform" or "heavy_tails" (Student's t with 4
            degrees of freedom).
    """

    parameters: tuple[DriverParameter, ...]
    truck_share: float = TRUCK_SHARE
    correlation: tuple[tuple[float, ...], ...] | None = None
    shape: str = "normal"

    def median(self, name: str) -> float:
        """Median of a parameter over cars."""
        return next(item.median for item in self.parameters if item.name == name)

    def draw(self, is_truck: np.ndarray, spread: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Parameters of every driver, [n]; `spread` multiplies the standard deviations."""
        scores = rng.standard_normal((len(self.parameters), len(is_truck)))
        if self.correlation is not None:
            scores = np.linalg.cholesky(np.array(self.correlation)) @ scores
        values = {}
        for item, deviation in zip(self.parameters, spread * _shaped(scores, self.shape), strict=True):
            cars, trucks = (
                median * np.exp(sd * deviation)
                for median, sd in ((item.median, item.sd), (item.truck_median, item.truck_sd))
            )
            values[item.name] = np.clip(np.where(is_truck, trucks, cars), item.low, item.high)
        return values


def _shaped(scores: np.ndarray, shape: str) -> np.ndarray:
    """Normal scores as deviates of unit variance of another distribution with the same ranks."""
    if shape == "uniform":
        return np.sqrt(3.0) * (2.0 * norm.cdf(scores) - 1.0)
    return t.ppf(norm.cdf(scores), 4) / np.sqrt(2.0) if shape == "heavy_tails" else scores


USUAL = Population(tuple(DriverParameter(name, *CARS[name], *TRUCKS[name], *BOUNDS[name]) for name in CARS))
"""Drivers of the scenarios whose population is not drawn."""

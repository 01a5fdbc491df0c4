"""The vehicles and drivers of all runs: who drives at which place of which convoy, and how."""

from dataclasses import dataclass

import numpy as np

RUNS = 9
"""Convoy runs per dataset, each with its own crew; every third has cars only."""

VEHICLES = 10
"""Vehicles per convoy with the lead vehicle; Jiang et al. (2014) drove 25, Makridis et al. (2021) 5 to 11."""

TRUCK_SHARE = 0.3
"""Probability that a vehicle of a mixed run is a truck."""


@dataclass(frozen=True)
class Fleet:
    """Vehicles and drivers, every array [runs, vehicles]; the lead vehicle is column 0.

    Attributes:
        is_truck: True for heavy goods vehicles.
        length: Vehicle length [m].
        width: Vehicle width [m].
        desired_speed: Speed on a free road [m/s].
        time_gap: Desired time gap T [s].
        standstill_gap: Gap at which the optimal velocity is 0 [m].
        adaptation_time: Time tau in which the optimal velocity is approached [s].
        approach_gain: Gain lambda of the relative speed [1/s].
        start_acceleration: Largest acceleration at standstill [m/s²].
        cruise_acceleration: Largest acceleration at 25 m/s [m/s²].
    """

    is_truck: np.ndarray
    length: np.ndarray
    width: np.ndarray
    desired_speed: np.ndarray
    time_gap: np.ndarray
    standstill_gap: np.ndarray
    adaptation_time: np.ndarray
    approach_gain: np.ndarray
    start_acceleration: np.ndarray
    cruise_acceleration: np.ndarray


def spread(rng: np.random.Generator, mean: float, variation: float, shape: tuple[int, ...]) -> np.ndarray:
    """Log-normal values of this mean and coefficient of variation, cut at 2.2 standard deviations."""
    sigma = np.sqrt(np.log1p(variation**2))
    normal = np.clip(rng.standard_normal(shape), -2.2, 2.2)
    return mean * np.exp(sigma * normal - sigma**2 / 2)


def draw(rng: np.random.Generator) -> Fleet:
    """Vehicles and drivers of all runs.

    Typical values of the full velocity difference model are tau = 5 s, lambda = 0.6 1/s, s0 = 3 m and T = 1.4 s
    (Treiber and Kesting 2013, chapter 10). Drivers of one class differ widely (Ossen and Hoogendoorn 2011).
    Trucks are governed at 90 km/h (Directive 2002/85/EC), keep longer gaps, and accelerate at less than half the rate
    of cars (Rakha et al. 2001).
    """
    shape = (RUNS, VEHICLES)
    mixed = (np.arange(RUNS) % 3 != 0)[:, None]
    is_truck = (rng.random(shape) < TRUCK_SHARE) & mixed

    def by_class(car: np.ndarray, truck: np.ndarray) -> np.ndarray:
        return np.where(is_truck, truck, car)

    return Fleet(
        is_truck=is_truck,
        length=by_class(np.clip(rng.normal(4.5, 0.35, shape), 3.6, 5.4), rng.choice([9.5, 12.0, 16.5], shape)),
        width=by_class(np.clip(rng.normal(1.82, 0.06, shape), 1.65, 2.0), np.full(shape, 2.55)),
        desired_speed=by_class(np.clip(rng.normal(34.0, 2.5, shape), 29.0, 40.0), rng.normal(24.7, 0.3, shape)),
        time_gap=by_class(spread(rng, 1.3, 0.25, shape), spread(rng, 1.6, 0.2, shape)),
        standstill_gap=by_class(spread(rng, 3.2, 0.2, shape), spread(rng, 3.8, 0.2, shape)),
        adaptation_time=by_class(spread(rng, 4.5, 0.2, shape), spread(rng, 5.5, 0.15, shape)),
        approach_gain=spread(rng, 0.65, 0.2, shape),
        start_acceleration=by_class(spread(rng, 2.4, 0.15, shape), spread(rng, 1.1, 0.1, shape)),
        cruise_acceleration=by_class(spread(rng, 1.2, 0.15, shape), spread(rng, 0.3, 0.1, shape)),
    )

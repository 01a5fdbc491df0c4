"""Vehicles and their drivers: sizes, and traits that differ and are correlated.

Sources
-------
Ossen & Hoogendoorn (2011), Heterogeneity in car-following behavior, Transp. Res. C 19: drivers differ, trucks keep
    longer gaps and drive more evenly.
Kim & Mahmassani (2011), Correlated parameters in driving behavior models, TRR 2249: traits are correlated.
Treiber & Kesting (2013), Traffic Flow Dynamics, ch. 11: usual parameters of cars and trucks.
Toledo & Zohar (2007), Modeling duration of lane changes, TRR 1999: mean 4.6 s.
Keane & Gao (2021), Formulation of the relaxation phenomenon, Transp. Res. C 125: relaxation over about 10 s.
Cowan (1975), Useful headway models, Transp. Res. 9: headways with a minimum and an exponential tail.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TRAITS = ("v0", "time_gap", "s0", "a", "b")
# Latent correlation of TRAITS: fast drivers keep short time gaps, accelerate and brake harder.
CORRELATION = np.array(
    [
        [1.00, -0.40, -0.10, 0.35, 0.20],
        [-0.40, 1.00, 0.30, -0.40, -0.30],
        [-0.10, 0.30, 1.00, -0.10, -0.10],
        [0.35, -0.40, -0.10, 1.00, 0.40],
        [0.20, -0.30, -0.10, 0.40, 1.00],
    ]
)
# Medians and coefficients of variation: desired speed [m/s], time gap [s], standstill gap [m], accelerations [m/s^2].
CARS = {"v0": (33.0, 0.12), "time_gap": (1.15, 0.28), "s0": (2.1, 0.22), "a": (1.5, 0.20), "b": (2.0, 0.20)}
TRUCKS = {"v0": (24.4, 0.03), "time_gap": (1.75, 0.22), "s0": (2.9, 0.20), "a": (0.75, 0.20), "b": (1.6, 0.15)}
LIMITS = {"v0": (20.0, 48.0), "time_gap": (0.6, 3.2), "s0": (1.3, 5.0), "a": (0.4, 2.6), "b": (1.0, 3.5)}


@dataclass
class Drivers:
    """One entry per vehicle that may drive, in SI units."""

    truck: np.ndarray
    length: np.ndarray
    width: np.ndarray
    v0: np.ndarray
    time_gap: np.ndarray
    s0: np.ndarray
    a: np.ndarray
    b: np.ndarray
    offset: np.ndarray  # habitual lateral place, from the middle of the lane [m]
    duration: np.ndarray  # of a lane change [s]
    threshold: np.ndarray  # gain of speed that makes a lane change attractive [m/s]
    critical: np.ndarray  # factor on critical gaps of lane changes [-]
    relaxation: np.ndarray  # time in which a short gap after a lane change is given up [s]
    notice: np.ndarray  # share of a lane change after which the follower behind the gap reacts [-]
    noise: np.ndarray  # standard deviation of the acceleration noise [m/s^2]

    def __len__(self) -> int:
        return len(self.truck)


def lognormal(rng: np.random.Generator, median: float, cv: float, n: int) -> np.ndarray:
    """Lognormal draws by median and coefficient of variation."""
    return median * np.exp(np.sqrt(np.log1p(cv**2)) * rng.standard_normal(n))


def draw_drivers(rng: np.random.Generator, truck: np.ndarray) -> Drivers:
    """Traits by a Gaussian copula with lognormal margins, cut at LIMITS."""
    n = len(truck)
    latent = rng.multivariate_normal(np.zeros(len(TRAITS)), CORRELATION, n)
    traits = {}
    for k, name in enumerate(TRAITS):
        median = np.where(truck, TRUCKS[name][0], CARS[name][0])
        spread = np.sqrt(np.log1p(np.where(truck, TRUCKS[name][1], CARS[name][1]) ** 2))
        traits[name] = np.clip(median * np.exp(spread * latent[:, k]), *LIMITS[name])
    long = rng.random(n) < 0.7  # articulated lorries and rigid ones
    truck_length = np.where(long, rng.normal(16.3, 0.7, n), rng.normal(9.5, 1.2, n))
    car_length = np.clip(rng.normal(4.55, 0.4, n), 3.5, 6.2)
    return Drivers(
        truck=truck,
        length=np.where(truck, np.clip(truck_length, 7.0, 18.75), car_length),
        width=np.where(truck, 2.5, np.clip(rng.normal(1.83, 0.08, n), 1.6, 2.1)),
        **traits,
        offset=np.where(
            truck, np.clip(rng.normal(0.0, 0.15, n), -0.3, 0.3), np.clip(rng.normal(0, 0.33, n), -0.65, 0.65)
        ),
        duration=np.clip(lognormal(rng, 4.7, 0.25, n), 3.0, 8.5),
        threshold=np.where(truck, 3.5, 1.0) * lognormal(rng, 2.0, 0.4, n),
        critical=lognormal(rng, 1.0, 0.25, n),
        relaxation=np.clip(lognormal(rng, 10.0, 0.4, n), 4.0, 25.0),
        notice=rng.uniform(0.12, 0.38, n),
        noise=np.clip(lognormal(rng, 0.12, 0.3, n), 0.05, 0.3) * np.where(truck, 0.7, 1.0),
    )


def arrival_times(rng: np.random.Generator, flow: float, until: float) -> np.ndarray:
    """Times [s] of arrivals in one lane at `flow` [vehicles/s]: least headway 0.9 s and an exponential rest (Cowan)."""
    least = 0.9
    n = int(1.3 * flow * until) + 30
    times = np.cumsum(least + rng.exponential(1.0 / flow - least, n))
    return times[times < until]


class Wander:
    """Ornstein-Uhlenbeck processes, one per vehicle, with correlation time `tau` [s], smoothed over `soft` [s].

    The variance is 1 before smoothing, and tau / (tau + soft) after it.
    """

    def __init__(self, rng: np.random.Generator, n: int, tau: float, dt: float, soft: float):
        self.rng, self.keep = rng, float(np.exp(-dt / tau))
        self.push, self.near = float(np.sqrt(1.0 - self.keep**2)), float(1.0 - np.exp(-dt / soft))
        self.inner = rng.standard_normal(n)
        self.value = self.inner.copy()

    def step(self, who: np.ndarray) -> None:
        """Advance the processes of the vehicles `who` by one time step."""
        inner = self.keep * self.inner[who] + self.push * self.rng.standard_normal(len(who))
        self.inner[who] = inner
        self.value[who] += self.near * (inner - self.value[who])

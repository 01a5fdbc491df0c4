"""Car-following parameters of drivers who may change lanes: calibrated, or estimated from measured accelerations."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, Prior
from rearl_jax.discovery.observe.fit_state import FitState

MEMORY = 3.0
"""Time after which acceleration errors are independent [s]: twice the correlation time of drivers' noise. Source: Zhang
& Sun, arXiv:2210.03571 (highD, about 1.4 s).
"""

FIRST_SENSITIVITY = 3
"""Index of the first parameter that is a sensitivity (how strongly drivers accelerate or brake), after desired speed,
time gap and jam gap. The measured gap and speed contain the drivers' own noise and are smoothed, so all sensitivities
are underestimated; of these parameters, only the difference of each driver from the mean driver is used.
"""

FURTHEST = 4.0
"""Bound of a standardised parameter [-], because a few accelerations cannot determine larger values."""

ROUNDS = 8
"""Gauss-Newton steps; most drivers converge within four."""

STEP = 0.05
"""Step of the finite differences, in standard deviations between drivers [-]."""

HARD = 4.0
"""Absolute acceleration [m/s^2] beyond which a row is not counted as car following."""

_LEAST_ROWS = 1024
"""Smallest number of rows for which a program is compiled."""


@dataclass(frozen=True)
class KnownDrivers:
    """Calibrated car-following parameters of some vehicles, and population values for all others.

    Attributes:
        vehicle: Sorted numbers of the calibrated vehicles, as in `Measured.vehicle`.
        values: Parameters of these vehicles, in the order of the model's declaration.
        population: Parameters of a car and of a truck that were not calibrated.
        prior: Car-following model and prior distribution of its parameters.
    """

    vehicle: Int[np.ndarray, " known"]
    values: Float[np.ndarray, "known own"]
    population: Float[np.ndarray, "classes own"]
    prior: Prior = IDM_PRIOR

    def is_known(self, vehicle: Int[np.ndarray, " rows"]) -> Bool[np.ndarray, " rows"]:
        """True if each row's vehicle is calibrated."""
        return np.isin(vehicle, self.vehicle)

    @classmethod
    def of(cls, states: Sequence[FitState], prior: Prior = IDM_PRIOR) -> "KnownDrivers":
        """Drivers of calibrated states; no driver may be in two states."""
        vehicles, values = [np.empty(0, np.int64)], [np.empty((0, prior.size))]
        for state in states:
            vehicles.append(state.data.driver_values(state.data.vehicle))
            values.append(prior.values(state.z, state.truck))
        population = prior.values(states[0].mean, np.array([0, 1])) if states else prior.usual
        vehicle = np.concatenate(vehicles)
        order = np.argsort(vehicle)
        return cls(vehicle[order], np.concatenate(values)[order], population, prior)

    def of_vehicles(
        self, vehicle: Int[np.ndarray, " rows"], is_truck: Bool[np.ndarray, " rows"]
    ) -> Float[np.ndarray, "own rows"]:
        """Parameters of each row's vehicle; population values if the vehicle was not calibrated."""
        values = self.population[is_truck.astype(int)]
        if len(self.vehicle):
            place = np.minimum(np.searchsorted(self.vehicle, vehicle), len(self.vehicle) - 1)
            is_known = self.vehicle[place] == vehicle
            values[is_known] = self.values[place[is_known]]
        return values.T


def acceleration(
    model: str,
    own: Float[np.ndarray, "own rows"],
    speed: Float[np.ndarray, " rows"],
    gap: Float[np.ndarray, " rows"],
    leader_speed: Float[np.ndarray, " rows"],
    is_led: Bool[np.ndarray, " rows"],
) -> Float[np.ndarray, " rows"]:
    """Acceleration [m/s^2] of a car-following model.

    Args:
        model: Name of the model.
        own: Parameters of each row's driver, in the order of the model's declaration.
        speed, gap, leader_speed: Own speed [m/s], gap to the leader [m], its speed [m/s].
        is_led: False if there is no leader; gap and leader's speed are then ignored.
    """
    n = len(speed)
    size = max(_LEAST_ROWS, 1 << max(n - 1, 0).bit_length())  # rounded to few sizes, so that few programs are compiled

    def padded(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.ones(size - n, values.dtype)])

    numbers = np.stack([padded(values) for values in (*own, speed, gap, leader_speed, is_led)])
    return np.asarray(_acceleration(model, numbers))[:n]


@partial(jax.jit, static_argnums=0)
def _acceleration(model: str, numbers: Float[Array | np.ndarray, "columns rows"]) -> Float[Array, " rows"]:
    *own, speed, gap, leader_speed, is_led = numbers
    driver = CAR_FOLLOWING[model](*own)
    return driver.free_acceleration(speed) - is_led * driver.interaction(gap, speed, speed - leader_speed)


def likely_parameters(
    population: Float[np.ndarray, "own rows"],
    driver: Int[np.ndarray, " rows"],
    speed: Float[np.ndarray, " rows"],
    gap: Float[np.ndarray, " rows"],
    leader_speed: Float[np.ndarray, " rows"],
    measured_acceleration: Float[np.ndarray, " rows"],
    is_led: Bool[np.ndarray, " rows"],
    period: float,
    prior: Prior,
) -> Float[np.ndarray, "own rows"]:
    """Maximum a posteriori parameters of each row's driver, from its measured accelerations.

    This estimate is coarser than the calibration by an observer, but handles thousands of drivers at once. Own
    parameters are needed because the gain of a lane change depends most on the driver's time gap: with one time gap for
    all, politeness and aversion to trucks would be found where there are none.

    Args:
        population: Population parameters for each row's driver.
        driver: Driver of each row, numbered from 0.
        speed, gap, leader_speed: Own speed [m/s], gap to the leader [m], its speed [m/s].
        measured_acceleration: Acceleration [m/s^2].
        is_led: True if there is a leader; other rows are not used.
        period: Time between two rows of a driver [s].
        prior: Car-following model and prior distribution of its parameters.

    Source: Gauss-Newton with a normal prior, Gelman et al., Bayesian Data Analysis (2013), ch. 13; drivers' spread as
    in `drivers.Prior`.
    """
    n = int(driver.max()) + 1 if len(driver) else 0  # drivers
    used = np.flatnonzero(is_led & (gap > 0.0) & (np.abs(measured_acceleration) < HARD))
    if not len(used):
        return population
    speed, gap, leader_speed, measured = (values[used] for values in (speed, gap, leader_speed, measured_acceleration))
    all_led, base, driver_used = np.ones(len(used), bool), population[:, used], driver[used]
    n_own, spread = prior.size, prior.spread
    z = np.zeros((n, n_own))

    def predicted(numbers: np.ndarray) -> np.ndarray:
        params = base * np.exp(spread[:, None] * numbers[driver_used].T)
        return np.clip(acceleration(prior.name, params, speed, gap, leader_speed, all_led), -HARD, HARD)

    for _ in range(ROUNDS):
        prediction = predicted(z)
        error = measured - prediction
        # 0.455 is the median of the square of a standard normal number. Errors are correlated over MEMORY, so each row
        # counts as period / MEMORY independent ones.
        variance = max(float(np.median(error**2)) / 0.455, 1e-4) * MEMORY / period
        slopes = np.stack([(predicted(z + STEP * np.eye(n_own)[k]) - prediction) / STEP for k in range(n_own)])
        gram = np.empty((n, n_own, n_own))
        gradient = np.empty((n, n_own))
        for i in range(n_own):
            gradient[:, i] = np.bincount(driver_used, slopes[i] * error, n) / variance - z[:, i]
            for j in range(i + 1):
                gram[:, i, j] = gram[:, j, i] = np.bincount(driver_used, slopes[i] * slopes[j], n) / variance
        step = np.linalg.solve(gram + np.eye(n_own), gradient[..., None])[..., 0]
        z = np.clip(z + np.clip(step, -1.0, 1.0), -FURTHEST, FURTHEST)
    z[:, FIRST_SENSITIVITY:] -= z[np.unique(driver_used)][:, FIRST_SENSITIVITY:].mean(axis=0)
    z[np.bincount(driver_used, minlength=n) == 0] = 0.0  # drivers without data keep the population's parameters
    return population * np.exp(spread[:, None] * z[driver].T)

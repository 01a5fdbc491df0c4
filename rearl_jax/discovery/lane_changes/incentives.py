"""Gain of drivers by a change of lanes, by their own car following as it was calibrated."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, Prior
from rearl_jax.discovery.observe.solver import FitState


@dataclass(frozen=True)
class KnownDrivers:
    """Calibrated car-following parameters of some vehicles, and those of everybody else.

    Attributes:
        vehicle: Numbers of the vehicles as in `Measured.vehicle`, rising.
        values: Their parameters, in the order of the model's declaration.
        usual: The same of a car and of a truck nobody has calibrated.
        prior: Their car-following model, and what is usual of drivers.
    """

    vehicle: Int[np.ndarray, " known"]
    values: Float[np.ndarray, "known own"]
    usual: Float[np.ndarray, "classes own"]
    prior: Prior = IDM_PRIOR

    def is_known(self, vehicle: Int[np.ndarray, " rows"]) -> Bool[np.ndarray, " rows"]:
        """True if each row's vehicle is calibrated."""
        return np.isin(vehicle, self.vehicle)

    @classmethod
    def of(cls, states: Sequence[FitState], prior: Prior = IDM_PRIOR) -> "KnownDrivers":
        """The drivers of calibrated states, which share none."""
        vehicles, values = [np.empty(0, np.int64)], [np.empty((0, prior.size))]
        for state in states:
            of_driver = np.zeros(state.data.n_drivers, np.int64)
            of_driver[state.data.driver] = state.data.vehicle
            vehicles.append(of_driver)
            values.append(prior.values(state.z, state.truck))
        usual = prior.values(states[0].mean, np.array([0, 1])) if states else prior.usual
        vehicle = np.concatenate(vehicles)
        order = np.argsort(vehicle)
        return cls(vehicle[order], np.concatenate(values)[order], usual, prior)

    def of_vehicles(
        self, vehicle: Int[np.ndarray, " rows"], is_truck: Bool[np.ndarray, " rows"]
    ) -> Float[np.ndarray, "own rows"]:
        """Parameters of each row's vehicle; those of its population where it is not known."""
        out = self.usual[is_truck.astype(int)]
        if len(self.vehicle):
            place = np.minimum(np.searchsorted(self.vehicle, vehicle), len(self.vehicle) - 1)
            found = self.vehicle[place] == vehicle
            out[found] = self.values[place[found]]
        return out.T


def acceleration(
    model: str,
    own: Float[np.ndarray, "own rows"],
    speed: Float[np.ndarray, " rows"],
    gap: Float[np.ndarray, " rows"],
    leader_speed: Float[np.ndarray, " rows"],
    is_led: Bool[np.ndarray, " rows"],
) -> Float[np.ndarray, " rows"]:
    """Acceleration of drivers [m/s^2] of a car-following model behind a leader at a gap [m], or free."""
    n = len(speed)
    size = max(_LEAST_ROWS, 1 << max(n - 1, 0).bit_length())  # few sizes, few programs to compile

    def padded(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.ones(size - n, values.dtype)])

    numbers = np.stack([padded(values) for values in (*own, speed, gap, leader_speed, is_led)])
    return np.asarray(_acceleration(model, numbers))[:n]


_LEAST_ROWS = 1024


@partial(jax.jit, static_argnums=0)
def _acceleration(model: str, numbers: Float[Array | np.ndarray, "columns rows"]) -> Float[Array, " rows"]:
    *own, speed, gap, leader_speed, is_led = numbers
    driver = CAR_FOLLOWING[model](*own)
    return driver.free_acceleration(speed) - is_led * driver.interaction(gap, speed, speed - leader_speed)

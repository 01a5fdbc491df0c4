"""What drivers gain by a change of lanes, by their own car following as it was calibrated."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.gap_idm import FollowingParams, free_term, gap_interaction
from rearl_jax.discovery.drivers import CAR, TRUCK, following_params
from rearl_jax.discovery.solver import World


@dataclass(frozen=True)
class KnownDrivers:
    """Calibrated car-following parameters of some vehicles, and those of everybody else.

    Attributes:
        vehicle: Numbers of the vehicles as in `Measured.vehicle`, rising.
        values: Their v0 [m/s], T [s], s0 [m], a, b [m/s^2], in this order.
        usual: The same of a car and of a truck nobody has calibrated.
    """

    vehicle: Int[np.ndarray, " known"]
    values: Float[np.ndarray, "known own"]
    usual: Float[np.ndarray, "classes own"]

    def is_known(self, vehicle: Int[np.ndarray, " rows"]) -> Bool[np.ndarray, " rows"]:
        """Whether each row's vehicle is calibrated."""
        return np.isin(vehicle, self.vehicle)

    @classmethod
    def of(cls, worlds: Sequence[World]) -> "KnownDrivers":
        """The drivers of calibrated worlds, which share none."""
        vehicles, values = [np.empty(0, np.int64)], [np.empty((0, 5))]
        for world in worlds:
            of_driver = np.zeros(world.data.n_drivers, np.int64)
            of_driver[world.data.driver] = world.data.vehicle
            vehicles.append(of_driver)
            values.append(_numbers(world.z, world.truck))
        usual = _numbers(worlds[0].mean, np.array([0, 1])) if worlds else np.stack([CAR, TRUCK])
        vehicle = np.concatenate(vehicles)
        order = np.argsort(vehicle)
        return cls(vehicle[order], np.concatenate(values)[order], usual)

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


def _numbers(z: np.ndarray, truck: np.ndarray) -> np.ndarray:
    """Parameters, one row per driver, of standardised ones."""
    params = following_params(jnp.asarray(z.T), jnp.asarray(truck, z.dtype))
    names = ("desired_speed", "time_gap", "jam_gap", "max_accel", "comfort_decel")
    return np.stack([np.asarray(getattr(params, name)) for name in names], axis=1)


def acceleration(
    own: Float[np.ndarray, "own rows"],
    speed: Float[np.ndarray, " rows"],
    gap: Float[np.ndarray, " rows"],
    leader_speed: Float[np.ndarray, " rows"],
    is_led: Bool[np.ndarray, " rows"],
) -> Float[np.ndarray, " rows"]:
    """Acceleration of drivers [m/s^2] behind a leader at a gap [m], or free."""
    n = len(speed)
    size = max(_LEAST_ROWS, 1 << max(n - 1, 0).bit_length())  # few sizes, few programs to compile

    def padded(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.ones(size - n, values.dtype)])

    numbers = [padded(values) for values in (*own, speed, gap, leader_speed, is_led)]
    return np.asarray(_acceleration(*numbers))[:n]


_LEAST_ROWS = 1024


@jax.jit
def _acceleration(
    desired_speed: Array,
    time_gap: Array,
    jam_gap: Array,
    max_accel: Array,
    comfort_decel: Array,
    speed: Array,
    gap: Array,
    leader_speed: Array,
    is_led: Array,
) -> Array:
    params = FollowingParams(desired_speed, time_gap, jam_gap, max_accel, comfort_decel)
    pull = gap_interaction(gap, speed, speed - leader_speed, params)
    return max_accel * (1 - free_term(speed, desired_speed) - jnp.where(is_led, pull, 0.0))

"""Standardised driver parameters z: logarithms relative to that of the median, divided by the standard deviation of the
logarithm between drivers.

Which parameters there are, their usual values, spreads and bounds follow from the declaration of the car-following
model (`rearl_jax.config.driver`).
"""

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from rearl_jax.config.driver import DriverConfig, record_of
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.car_following.model import CarFollowing


@dataclass(frozen=True)
class Prior:
    """Prior distribution of drivers' parameters; hashable.

    Attributes:
        name: Name of the car-following model.
        usual_car: Median parameters of car drivers, in the order of the model's declaration.
        usual_truck: Median parameters of truck drivers.
        is_bounded: Whether parameters stay within their declared bounds.
    """

    name: str
    usual_car: tuple[float, ...]
    usual_truck: tuple[float, ...]
    is_bounded: bool = True

    @property
    def model(self) -> type[CarFollowing]:
        """The car-following model."""
        return CAR_FOLLOWING[self.name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.model.declaration.names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters."""
        return tuple(parameter.unit for parameter in self.model.declaration.parameters)

    @property
    def size(self) -> int:
        """Number of parameters of a driver."""
        return len(self.usual_car)

    @property
    def usual(self) -> Float[np.ndarray, "classes own"]:
        """Median parameters of cars and of trucks."""
        return np.array([self.usual_car, self.usual_truck])

    @property
    def spread(self) -> Float[np.ndarray, " own"]:
        """Standard deviations of the parameters' logarithms between drivers [-]."""
        return np.array([parameter.spread for parameter in self.model.declaration.parameters])

    @property
    def location_precision(self) -> Float[np.ndarray, " own"]:
        """Inverse prior variance of the mean of a population's standardised parameters [-]; 1 if not declared."""
        location = np.array([parameter.location or parameter.spread for parameter in self.model.declaration.parameters])
        return (self.spread / location) ** 2

    @property
    def bounds(self) -> tuple[Float[np.ndarray, "classes own"], Float[np.ndarray, "classes own"]]:
        """Bounds of the standardised parameters of cars and of trucks [-]; infinite without bounds."""
        if not self.is_bounded:
            return np.full_like(self.usual, -np.inf), np.full_like(self.usual, np.inf)
        parameters = self.model.declaration.parameters
        limits = (np.array([getattr(parameter, end) for parameter in parameters]) for end in ("low", "high"))
        low, high = ((np.log(limit) - np.log(self.usual)) / self.spread for limit in limits)
        return low, high

    def values(
        self, z: Float[np.ndarray, "drivers own"], truck: Int[np.ndarray, " drivers"]
    ) -> Float[np.ndarray, "drivers own"]:
        """Parameters of drivers whose standardised parameters are z; `truck` is 0 for cars and 1 for trucks."""
        return self.usual[truck] * np.exp(self.spread * z)

    def drivers(self, z: Float[Any, "own pieces"], is_truck: Float[Any, " pieces"]) -> CarFollowing:
        """Car following of drivers whose standardised parameters are z."""
        truck = jnp.asarray(is_truck)[None]
        car_logs, truck_logs = (jnp.log(jnp.asarray(row))[:, None] for row in self.usual)
        medians = car_logs * (1 - truck) + truck_logs * truck
        return self.model(*jnp.exp(medians + jnp.asarray(self.spread)[:, None] * z))


def prior_of(driver: DriverConfig) -> Prior:
    """The prior of a `driver` configuration; trucks differ from cars as in the published defaults."""
    parameters = driver.declaration.parameters
    given = [getattr(driver, parameter.name) for parameter in parameters]  # None if drawn with the initial state
    medians = [parameter.prior_median for parameter in parameters]
    car = tuple(m if value is None else float(value) for m, value in zip(medians, given, strict=True))
    # A parameter that was given another value for cars is changed for trucks by the same factor.
    ratios = [each.truck / m if each.truck else 1.0 for each, m in zip(parameters, medians, strict=True)]
    truck = tuple(value * ratio for value, ratio in zip(car, ratios, strict=True))
    return Prior(driver.model, car, truck)


IDM_PRIOR = prior_of(record_of("idm")())
"""The prior of the published Intelligent Driver Model."""

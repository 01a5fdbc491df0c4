"""Declaration of a car-following model: its parameters with unit, typical value, spread, bounds and source.

One declaration serves the command line (keys, defaults, help), the simulation (populations of drivers) and the
calibration (priors and bounds). Standard library only, so that `--help` need not load JAX.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class DriverParameter:
    """One parameter of a driver. Parameters are positive; their logarithms vary between drivers.

    Attributes:
        name: Field of the model's class.
        unit: Unit; "-" for none.
        meaning: Meaning in one line.
        usual: Typical value for cars; None if highway-env draws it with the initial state.
        low, high: Bounds of the values, wide enough for every driver.
        source: Source of the typical value.
        spread: Standard deviation of the logarithm between drivers [-], the prior of a calibration. Source of the order
            of magnitude: Kesting & Treiber, Transp. Res. Rec. 2088 (2008) 148.
        truck: Typical value for trucks; None for that of cars.
        location: Standard deviation of the logarithm of a population's median around the typical value [-]; None for
            `spread`.
        median: Median of cars in the prior of a calibration; None for `usual`.
    """

    name: str
    unit: str
    meaning: str
    usual: float | None
    low: float
    high: float
    source: str
    spread: float = 0.3
    truck: float | None = None
    location: float | None = None
    median: float | None = None

    @property
    def prior_median(self) -> float:
        """Median of cars in the prior of a calibration.

        Raises:
            ValueError: Neither `median` nor `usual` is declared.
        """
        median = self.usual if self.median is None else self.median
        if median is None:
            raise ValueError(f"{self.name}: declare `usual`, or `median` if the value is drawn with the initial state")
        return median


@dataclass(frozen=True)
class DriverModel:
    """One car-following model.

    Attributes:
        name: Name in `driver=NAME`, and of its module in `rearl_jax.core.car_following`.
        title: Title in one line.
        source: Source of its equation.
        parameters: Parameters, in the order of the rows of covariance matrices; desired speed, time gap and jam gap,
            which every model has, come first.
    """

    name: str
    title: str
    source: str
    parameters: tuple[DriverParameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)


_TABLE = "near Treiber & Kesting, Traffic Flow Dynamics (2013), table 11.2"

_CAR_SPEED = 32.0
"""Usual desired speed of cars on a motorway [m/s], as in that table."""


def desired_speed(usual: float | None = _CAR_SPEED, source: str = _TABLE) -> DriverParameter:
    """Desired speed v0, which every model has."""
    # Congested traffic contains little information about it, so with a wide spread the estimate would diverge. The
    # median differs far more between roads, from 30 km/h on a test track to motorways without limit.
    return DriverParameter(
        "desired_speed",
        "m/s",
        "desired speed v0",
        usual,
        1.0,
        100.0,
        source,
        0.12,
        25.0,
        location=0.5,
        median=_CAR_SPEED,
    )


def time_gap(usual: float = 1.25, source: str = _TABLE) -> DriverParameter:
    """Desired time gap T, which every model has."""
    return DriverParameter("time_gap", "s", "desired time gap T", usual, 0.05, 10.0, source, truck=1.6)


def jam_gap(usual: float = 2.5, source: str = _TABLE) -> DriverParameter:
    """Standstill gap s0, which every model has."""
    # Below the lower bound the response of the models does not grow further, and vehicles would not stop.
    return DriverParameter("jam_gap", "m", "bumper-to-bumper gap s0 at standstill", usual, 0.5, 20.0, source)


def max_accel(usual: float = 1.4, source: str = _TABLE) -> DriverParameter:
    """Largest acceleration a."""
    return DriverParameter("max_accel", "m/s^2", "largest acceleration a", usual, 0.05, 10.0, source, truck=0.9)


def comfort_decel(usual: float = 2.0, source: str = _TABLE) -> DriverParameter:
    """Comfortable deceleration b."""
    return DriverParameter(
        "comfort_decel", "m/s^2", "comfortable deceleration b, positive", usual, 0.05, 20.0, source, 0.35
    )


def approach_gain(usual: float, source: str) -> DriverParameter:
    """Gain of the approach rate."""
    return DriverParameter("approach_gain", "1/s", "deceleration per approach rate", usual, 0.01, 5.0, source, 0.5)


def speed_gain(usual: float, source: str) -> DriverParameter:
    """Gain of the difference to the desired speed."""
    meaning = "acceleration per speed deficit, on a free road"
    return DriverParameter("speed_gain", "1/s", meaning, usual, 0.01, 5.0, source, 0.5)

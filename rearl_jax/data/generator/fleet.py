"""Vehicles of the generator: constants of all drivers of a recording, the state of those on the road, their situation
at one time step, and the bottleneck that causes stop-and-go traffic.
"""

from dataclasses import dataclass, fields

import numpy as np

from rearl_jax.config.generator import GeneratorConfig

TRUCK_EAGERNESS = 0.6  # lane-change rate of trucks relative to cars
LATERAL_BIAS_SD = 0.12  # standard deviation of the drivers' constant offset from the lane centre [m]


@dataclass(frozen=True)
class Drivers:
    """Constants of drivers and their vehicles; arrays over vehicles.

    Attributes:
        is_truck: Class of the vehicle.
        length, width: Size [m].
        desired_speed: Speed on an empty road [m/s].
        max_accel: Acceleration scale of the Gipps model [m/s^2].
        braking: Deceleration that a driver expects of this vehicle and of the leader [m/s^2], positive.
        comfort_decel: Deceleration not exceeded unless needed to avoid a collision [m/s^2], positive.
        reaction_time: Reaction time [s].
        time_gap: Bumper to bumper time gap kept while following steadily [s].
        jam_gap: Gap at standstill [m].
        critical_gap: Smallest time gap accepted when changing lanes [s].
        eagerness: Factor on the lane-change rate.
        change_duration: Duration of a lane change [s].
        lateral_bias: Constant offset from the lane centre [m].
    """

    is_truck: np.ndarray
    length: np.ndarray
    width: np.ndarray
    desired_speed: np.ndarray
    max_accel: np.ndarray
    braking: np.ndarray
    comfort_decel: np.ndarray
    reaction_time: np.ndarray
    time_gap: np.ndarray
    jam_gap: np.ndarray
    critical_gap: np.ndarray
    eagerness: np.ndarray
    change_duration: np.ndarray
    lateral_bias: np.ndarray

    def take(self, index: np.ndarray) -> "Drivers":
        """The drivers with the given numbers."""
        return Drivers(*(getattr(self, item.name)[index] for item in fields(self)))


def draw_drivers(
    is_truck: np.ndarray,
    pace: np.ndarray,
    config: GeneratorConfig,
    speed_limit: float | None,
    rng: np.random.Generator,
) -> Drivers:
    """Drivers of given class and pace (see `Arrivals`), with parameters that vary between drivers.

    Spreads follow the usual ranges of Gipps-model calibrations (Gipps 1981; Ciuffo, Punzo and Montanino 2012); vehicle
    sizes are those of European cars (3.6 to 5.3 m) and of rigid and articulated trucks (8 to 18.75 m).
    """
    n = len(is_truck)
    # Drivers keep near a legal limit, most a little above it.
    limit_effect = 1.0 if speed_limit is None else min(1.0, (speed_limit + 1.5) / config.car_speed)

    def by_class(car: np.ndarray, truck: np.ndarray) -> np.ndarray:
        return np.where(is_truck, truck, car)

    def around(median: float, spread: float, low: float, high: float) -> np.ndarray:
        """Log-normal values with this median, limited to [low, high]."""
        return np.clip(median * np.exp(spread * rng.standard_normal(n)), low, high)

    def normal(mean: float, sd: float, n_sd: float = 2.5) -> np.ndarray:
        """Normal values, limited to `n_sd` standard deviations from the mean."""
        return mean + sd * np.clip(rng.standard_normal(n), -n_sd, n_sd)

    time_gap = by_class(around(config.car_time_gap, 0.40, 0.55, 3.0), around(config.truck_time_gap, 0.25, 1.0, 3.5))
    articulated = rng.random(n) < 0.75
    truck_length = np.where(articulated, normal(16.6, 0.9, 2.3), rng.uniform(8.0, 12.5, n))
    return Drivers(
        is_truck=is_truck,
        length=np.round(by_class(np.clip(normal(4.55, 0.35), 3.6, 5.4), truck_length), 2),
        width=np.round(by_class(np.clip(normal(1.90, 0.09), 1.65, 2.15), np.full(n, 2.50)), 2),
        desired_speed=by_class(
            limit_effect * (config.car_speed + config.car_speed_sd * pace),
            config.truck_speed + config.truck_speed_sd * pace,
        ),
        max_accel=by_class(around(1.5, 0.2, 0.9, 2.5), around(0.7, 0.15, 0.4, 1.1)),
        braking=by_class(around(3.0, 0.15, 2.2, 4.5), around(2.6, 0.15, 2.0, 3.5)),
        comfort_decel=around(1.4, 0.25, 0.8, 2.2),
        reaction_time=np.minimum(around(0.7, 0.15, 0.4, 1.0), time_gap / 1.5),
        time_gap=time_gap,
        jam_gap=around(2.3, 0.2, 1.5, 4.0),
        critical_gap=np.minimum(around(0.55, 0.3, 0.3, 1.2), 0.8 * time_gap),
        eagerness=around(1.0, 0.4, 0.3, 2.5) * by_class(np.ones(n), np.full(n, TRUCK_EAGERNESS)),
        change_duration=by_class(np.clip(normal(5.0, 0.6), 4.0, 6.5), np.clip(normal(6.0, 0.7), 4.5, 8.0)),
        lateral_bias=LATERAL_BIAS_SD
        * np.clip(rng.standard_normal(n), -2.0, 2.0)
        * by_class(np.ones(n), np.full(n, 0.7)),
    )


@dataclass
class Fleet:
    """The vehicles on the road: their drivers and their state; arrays over vehicles, in order of entry.

    Attributes:
        drivers: Constants of the drivers.
        vehicle: Number of the vehicle in the recording.
        direction: Carriageway, 1 or 2.
        lane: Lane, 0 = leftmost; the target lane from the start of a lane change on.
        origin: Lane still occupied during a change, -1 = none.
        position: Front bumper along the driving direction from the start of the road [m].
        speed: Speed [m/s].
        acceleration: Acceleration of the last step [m/s^2].
        noise: Acceleration noise, which varies slowly [m/s^2].
        lateral_target: Lateral offset that the driver aims at, from the usual position in the lane [m].
        lateral_offset: Present lateral offset from the usual position in the lane [m].
        change_start: Start of the last lane change [s].
        change_shift: Lateral distance from target lane to lane of origin [m], 0 = no change under way.
        ready_time: Earliest time of the next lane change [s].
    """

    drivers: Drivers
    vehicle: np.ndarray
    direction: np.ndarray
    lane: np.ndarray
    origin: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    noise: np.ndarray
    lateral_target: np.ndarray
    lateral_offset: np.ndarray
    change_start: np.ndarray
    change_shift: np.ndarray
    ready_time: np.ndarray

    @classmethod
    def empty(cls, drivers: Drivers) -> "Fleet":
        """A road without vehicles; `drivers` are those of the whole recording."""
        integers = {name: np.zeros(0, dtype=int) for name in ("vehicle", "direction", "lane", "origin")}
        floats = {name: np.zeros(0) for name in STATE if name not in integers}
        return cls(drivers.take(np.zeros(0, dtype=int)), **integers, **floats)

    def __len__(self) -> int:
        return len(self.vehicle)

    @property
    def is_moving_over(self) -> np.ndarray:
        """Mask of vehicles whose lane change is under way, also after they have left the lane of origin."""
        return self.change_shift != 0.0

    def keep(self, drivers: Drivers, mask: np.ndarray) -> None:
        """Remove the vehicles outside the mask from the road."""
        for name in STATE:
            setattr(self, name, getattr(self, name)[mask])
        self.drivers = drivers.take(self.vehicle)

    def enter(self, drivers: Drivers, **state: np.ndarray) -> None:
        """Add vehicles to the road; state that is not given starts at zero."""
        n = len(state["vehicle"])
        for name in STATE:
            present = getattr(self, name)
            added = np.asarray(state.get(name, np.zeros(n)), dtype=present.dtype)
            setattr(self, name, np.concatenate([present, added]))
        self.drivers = drivers.take(self.vehicle)


STATE = tuple(item.name for item in fields(Fleet) if item.name != "drivers")


@dataclass(frozen=True)
class Situation:
    """Traffic as the drivers on the road perceive it at one time step; arrays over the vehicles of the fleet.

    Attributes:
        time: Time since the start of the simulation [s].
        fleet: Drivers and their own state.
        gap: Bumper to bumper distance to the leader [m], inf if there is none.
        leader_speed: Speed of the leader [m/s]; the driver's own speed if there is none.
        leader_acceleration: Acceleration of the leader [m/s^2]; 0 if there is none.
    """

    time: float
    fleet: Fleet
    gap: np.ndarray
    leader_speed: np.ndarray
    leader_acceleration: np.ndarray


@dataclass(frozen=True)
class SpeedRestriction:
    """Bottleneck whose passable speed changes in phases, so that stop-and-go waves start there.

    Attributes:
        direction: Carriageway it lies on.
        start, end: Stretch of road [m].
        times: Start of each phase [s], in ascending order; before the first there is no restriction.
        speeds: Passable speed in each phase [m/s].
    """

    direction: int
    start: float
    end: float
    times: tuple[float, ...]
    speeds: tuple[float, ...]

    def limited(self, desired_speed: np.ndarray, situation: Situation) -> np.ndarray:
        """Desired speed of every driver, at most the passable speed for those in the bottleneck [m/s]."""
        phase = int(np.searchsorted(self.times, situation.time, side="right")) - 1
        if phase < 0:
            return desired_speed
        fleet = situation.fleet
        inside = (fleet.position >= self.start) & (fleet.position <= self.end) & (fleet.direction == self.direction)
        return np.where(inside, np.minimum(desired_speed, self.speeds[phase]), desired_speed)

"""The scenario of a generated data set: vehicles, duration, measurement and hidden effects."""

from collections.abc import Mapping
from dataclasses import dataclass

from rearl_jax.blind.traffic.population import USUAL, Population
from rearl_jax.problems import out_of_range

SUB_STEP = 0.02
"""Time step of the integration [s]; a tenth of the shortest time constant in the model."""

FREE_CHANGES: Mapping[str, int | float] = {
    "free_changes": True,
    "n_vehicles": 360,
    "duration": 240.0,
    "frame_rate": 10.0,
}
"""Fields of a scenario in which drivers change lanes for their own advantage, some hundred times per recording."""


@dataclass(frozen=True)
class Planted:
    """A hidden effect or artefact, by its name in `catalogue`; its default strength is 1."""

    name: str
    strength: float = 1.0


@dataclass(frozen=True)
class Chain:
    """What the provider of the data does to them between measurement and release. Only the broad priors draw it.

    Attributes:
        kernel: Smoothing of positions and speeds before their release, a kernel of `priors.CHOICES`; "none" for no
            smoothing.
        kernel_time: Standard deviation of the kernel [s].
        speed: Source of the speed column: "positions" or "sensor".
        slope_time: Length of the window [s] in which a parabola is fitted to the positions; its slope is the speed.
        sensor_noise: Standard deviation of the speed sensor [m/s].
        lane: Event at which the lane column changes: "marking", the centre of the vehicle crosses the lane marking, or
            "decision", the driver begins to follow the new leader and to move sideways.
        change_time: Duration of the sideways motion in a lane change [s].
    """

    kernel: str = "none"
    kernel_time: float = 0.0
    speed: str = "positions"
    slope_time: float = 1.0
    sensor_noise: float = 0.0
    lane: str = "marking"
    change_time: float = 4.0


@dataclass(frozen=True)
class Scenario:
    """The scenario of one data set.

    Attributes:
        seed: Seed of all random draws. Each module combines it with a number of its own, so that the draws of modules
            are independent. Data sets with equal seed and fleet size have the same drivers.
        planted: Hidden effects and artefacts; empty in a control.
        n_recordings: Recordings of the same road, with different drivers.
        n_vehicles: Vehicles per recording, a multiple of the lanes; the first of each lane is a platoon leader.
        n_lanes: Number of lanes; there is one carriageway.
        duration: Recorded time [s].
        frame_rate: Frames per second [1/s]; a whole number of sub-steps fits between two frames.
        lane_changes: Forced lane changes per recording: at random times, whatever the driver gains by them.
        free_changes: Whether lane changes are discretionary (drivers change for their own advantage), not forced.
        spacing: Initial gap divided by the desired gap [-].
        pace: Factor on the speeds of platoon leaders [-].
        spread: Factor on the differences between drivers [-].
        driver_noise: Standard deviation of a driver's random acceleration [m/s^2].
        driver_noise_time: Correlation time of this acceleration [s].
        noise_spread: Standard deviation, between drivers, of the logarithm of the random acceleration's size [-].
        noise_growth: Relative growth of its size with the absolute acceleration of the vehicle [s^2/m].
        position_noise: Standard deviation of measured positions [m].
        noise_time: Correlation time of the errors of positions [s]; 0 for white noise.
        view: Length of road that a camera sees [m]; None if every vehicle is seen all the time.
        base: Car-following model, one of `models.BASES`.
        population: Distribution of the drivers' parameters.
        chain: Processing of the data by their provider; if None, positions have noise and speeds are their slopes.
    """

    seed: int
    planted: tuple[Planted, ...] = ()
    n_recordings: int = 3
    n_vehicles: int = 39
    n_lanes: int = 3
    duration: float = 60.0
    frame_rate: float = 10.0
    lane_changes: int = 12
    free_changes: bool = False
    spacing: float = 1.0
    pace: float = 1.0
    spread: float = 1.0
    driver_noise: float = 0.15
    driver_noise_time: float = 1.5
    noise_spread: float = 0.0
    noise_growth: float = 0.0
    position_noise: float = 0.1
    noise_time: float = 0.0
    view: float | None = None
    base: str = "idm"
    population: Population = USUAL
    chain: Chain | None = None

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a scenario that cannot be simulated."""
        if self.n_vehicles % self.n_lanes or self.n_vehicles < 2 * self.n_lanes:
            raise out_of_range("n_vehicles", f"must be a multiple of {self.n_lanes} lanes", self.n_vehicles)
        steps_per_frame = round(1.0 / (self.frame_rate * SUB_STEP))
        if abs(steps_per_frame * SUB_STEP * self.frame_rate - 1.0) > 1e-9:
            raise out_of_range("frame_rate", f"must leave whole steps of {SUB_STEP} s between frames", self.frame_rate)

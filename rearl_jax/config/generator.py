"""Configuration of the generated recordings: number, traffic, drivers, camera."""

import math
from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_within
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class GeneratorConfig:
    """Generated recordings in the highD format (for data.format=generated)."""

    seed: int = key(0, "seed of the set; a recording depends only on it and on its number")
    n_recordings: int = key(
        60, "number of recordings to write; existing ones are kept; highD has 60 (Krajewski et al. 2018)"
    )
    first_id: int = key(1, "number of the first recording, which names its files: 1 gives 01_tracks.csv")
    workers: int = key(0, "parallel processes, 0.8 GiB each; 0 = one per processor core")
    duration_scale: float = key(1.0, "factor on all durations [-]; below 1 for short test recordings")

    duration_mean: float = key(1000.0, "mean duration of a recording [s]; highD: 16.5 h in 60 recordings")
    duration_min: float = key(640.0, "shortest recording [s]; assumed")
    duration_max: float = key(1260.0, "longest recording [s]; assumed")
    vehicles_min: int = key(
        607, "fewest vehicles in a recording; counts of highD published with CRITICAL (Tian et al. 2024)"
    )
    vehicles_max: int = key(
        2949, "most vehicles in a recording; counts of highD published with CRITICAL (Tian et al. 2024)"
    )
    in_view_min: float = key(12.0, "lowest mean number of vehicles in view; derived from the highD counts")
    in_view_max: float = key(
        37.0, "highest mean number of vehicles in view without congestion; derived from the highD counts"
    )
    in_view_mean: float = key(
        24.15, "mean number of vehicles in view over the recordings without congestion; highD: 24.6 with it"
    )
    truck_share_min: float = key(
        0.08, "lowest share of trucks; counts of highD published with CRITICAL (Tian et al. 2024)"
    )
    truck_share_max: float = key(
        0.29, "highest share of trucks; counts of highD published with CRITICAL (Tian et al. 2024)"
    )
    truck_share_mean: float = key(
        0.192, "mean share of trucks; counts of highD published with CRITICAL (Tian et al. 2024)"
    )
    congested_share: float = key(0.07, "share of recordings with stop-and-go traffic in one direction; assumed")

    car_speed: float = key(
        38.3, "mean desired speed of cars without a speed limit [m/s]; gives about 33 m/s driven, as in highD"
    )
    car_speed_sd: float = key(2.7, "standard deviation of the cars' desired speed [m/s]; gives about 3.5 m/s driven")
    truck_speed: float = key(26.0, "mean desired speed of trucks [m/s]; legal 80 km/h, limiters at 89 km/h")
    truck_speed_sd: float = key(2.2, "standard deviation of the trucks' desired speed [m/s]; assumed")
    car_time_gap: float = key(
        1.1, "median time gap cars keep while following [s]; assumed, gives about 1.25 s measured below 60 m"
    )
    truck_time_gap: float = key(1.8, "median time gap trucks keep while following [s]; assumed")
    acceleration_noise: float = key(
        0.15, "standard deviation of the drivers' random acceleration [m/s^2]; Zhang and Sun 2022 find 0.2 in highD"
    )
    lane_change_rate: float = key(
        0.123,
        "rate of lane changes of a driver with full incentive and room [1/s]; fitted to highD's 5,600 lane changes",
    )

    camera_length: float = key(420.0, "road length in view [m]; Krajewski et al. 2018")
    approach_length: float = key(
        1000.0, "road length before the view, where traffic reaches its usual state [m]; assumed"
    )
    frames_per_step: int = key(2, "frames of 0.04 s per simulation step; the others are interpolated")
    position_noise: float = key(
        0.04, "standard deviation of a detected position [m]; Krajewski et al. 2018 state less than 0.10 m"
    )
    smoothing_cutoff: float = key(
        1.0, "frequency at which the smoothing of the tracker halves an amplitude [Hz]; assumed"
    )

    def check(self) -> None:
        check_least(self, 1, "n_recordings", "frames_per_step")
        for name in ("seed", "workers", "position_noise", "acceleration_noise", "lane_change_rate"):
            if not 0 <= getattr(self, name) < math.inf:
                raise out_of_range(name, "must be >= 0", getattr(self, name))
        if not (self.first_id >= 1 and self.first_id + self.n_recordings <= 1000):
            message = f"must be >= 1, and the last of {self.n_recordings} recordings below 1000"
            raise out_of_range("first_id", message, self.first_id)
        check_within(self, 0.05, 10.0, "duration_scale")
        check_finite(self, "duration_max")
        for stem in ("duration", "in_view", "truck_share"):
            low, mean, high = (getattr(self, f"{stem}_{part}") for part in ("min", "mean", "max"))
            if not 0.0 < low < mean < high:
                message = f"must lie between {stem}_min = {low} and {stem}_max = {high}"
                raise out_of_range(f"{stem}_mean", message, mean)
        if not self.truck_share_max < 0.6:
            raise out_of_range("truck_share_max", "must be < 0.6", self.truck_share_max)
        if not self.in_view_max <= 45.0:
            raise out_of_range("in_view_max", "must be <= 45, more does not fit the road", self.in_view_max)
        if not 0 < self.vehicles_min < self.vehicles_max:
            raise out_of_range("vehicles_min", "must be > 0 and below vehicles_max", self.vehicles_min)
        check_within(self, 0.0, 0.5, "congested_share")
        for name, low, high in _RANGES:
            check_within(self, low, high, name)


_RANGES = (
    ("car_speed", 15.0, 60.0),
    ("car_speed_sd", 0.0, 8.0),
    ("truck_speed", 15.0, 35.0),
    ("truck_speed_sd", 0.0, 5.0),
    ("car_time_gap", 0.8, 3.0),
    ("truck_time_gap", 0.8, 3.0),
    ("camera_length", 100.0, 900.0),
    ("approach_length", 200.0, 5000.0),
    ("frames_per_step", 1, 5),
    ("smoothing_cutoff", 0.2, 5.0),
)
"""Keys with their smallest and largest values."""

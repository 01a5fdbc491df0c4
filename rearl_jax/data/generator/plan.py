"""Plan of a recording: place, duration, traffic volume, truck share, congestion.

The design has 60 cells, one for each recording of highD. A cell defines the traffic of a recording as a quantile of the
published range, so that 60 recordings together reproduce highD's totals exactly; the seed assigns cells to recordings.
Recording 61 has the cell of recording 1 with other drivers.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator.fleet import SpeedRestriction
from rearl_jax.data.generator.road import LOWER, SECTIONS, UPPER, Section

N_CELLS = 60
CROSSING_TIME = 13.2  # mean time in view [s]: 24.6 vehicles x 16.5 h / 110,516 vehicles of highD
EXIT_LENGTH = 300.0  # road after the view [m]
WARM_UP = 150.0  # time before the recording starts [s]
# Stop-and-go traffic: phases at a bottleneck behind the view. Crawling traffic passes less than arrives, so
# that the waves it starts run upstream through the view; with these values the fullest recording has about 46
# vehicles in view on average, as in highD.
CONGESTED_TIME = 0.31  # share of the recording with phases
CRAWL_SPEED, CRAWL_TIME = (2.0, 5.0), (20.0, 35.0)  # [m/s], [s]
SLOW_SPEED, SLOW_TIME = (8.0, 13.0), (30.0, 60.0)  # [m/s], [s]
BOTTLENECK_DISTANCE, BOTTLENECK_LENGTH = 20.0, 250.0  # [m]
CONGESTED_LEVEL = 0.68  # congested recordings have traffic volumes up to this quantile
TWO_LANE_MAX_IN_VIEW = 21.0  # vehicles in view; more do not flow freely on 2 + 2 lanes


@dataclass(frozen=True)
class RecordingPlan:
    """Properties of a recording that are decided before its traffic is simulated.

    Attributes:
        id: Number of the recording.
        section: Place.
        duration: Recorded time [s].
        n_vehicles: Vehicles expected in view during that time.
        truck_share: Share of trucks.
        upper_share: Share of the traffic that drives on the upper carriageway.
        congestion: Bottleneck behind the view; None = traffic flows freely.
        month, week_day, start_time: As written to recordingMeta.
    """

    id: int
    section: Section
    duration: float
    n_vehicles: float
    truck_share: float
    upper_share: float
    congestion: SpeedRestriction | None
    month: str
    week_day: str
    start_time: str

    def flow(self, direction: int) -> float:
        """Vehicles per second that enter a carriageway."""
        share = self.upper_share if direction == UPPER else 1.0 - self.upper_share
        return share * self.n_vehicles / (self.duration + CROSSING_TIME)


def plan_recording(config: GeneratorConfig, recording_id: int) -> RecordingPlan:
    """The plan of one recording; depends on the seed and the recording's number only."""
    design = _design(config)
    cell = (recording_id - 1) % N_CELLS
    rng = np.random.default_rng([config.seed, recording_id, 1])
    duration = 0.04 * round(config.duration_scale * design.duration[cell] / 0.04)
    upper_share = float(rng.uniform(0.43, 0.57))
    busier = UPPER if upper_share > 0.5 else LOWER
    congestion = _bottleneck(config, busier, duration, rng) if design.congested[cell] else None
    return RecordingPlan(
        id=recording_id,
        section=SECTIONS[design.section[cell]],
        duration=duration,
        n_vehicles=float(design.vehicle_rate[cell] * (duration + CROSSING_TIME)),
        truck_share=float(design.truck_share[cell]),
        upper_share=upper_share,
        congestion=congestion,
        month=f"{rng.integers(1, 13):02d}.{rng.integers(2017, 2019)}",
        week_day=str(rng.choice(["Mon", "Tue", "Wed", "Thu", "Fri"])),
        start_time=f"{rng.integers(7, 19):02d}:{rng.integers(0, 60):02d}",
    )


@dataclass(frozen=True)
class _Design:
    """Design of the recordings, arrays over cells: duration before scaling [s], vehicles of both directions per second,
    share of trucks, whether there is stop-and-go traffic, and index into SECTIONS.
    """

    duration: np.ndarray
    vehicle_rate: np.ndarray
    truck_share: np.ndarray
    congested: np.ndarray
    section: np.ndarray


def _design(config: GeneratorConfig) -> _Design:
    """The cells in the order in which recordings take them; before the shuffle they are sorted by traffic."""
    rng = np.random.default_rng([config.seed, 0])
    cell = np.arange(N_CELLS)
    level = (cell + 0.5) / N_CELLS
    in_view = _quantiles(level, config.in_view_min, config.in_view_mean, config.in_view_max, 1.3)
    duration = rng.permutation(_quantiles(level, config.duration_min, config.duration_mean, config.duration_max, 2.5))
    # The shortest recording takes the lightest traffic, so that the counts reach down to vehicles_min.
    shortest = int(np.argmin(duration))
    duration[[0, shortest]] = duration[[shortest, 0]]
    n_vehicles = in_view * (duration + CROSSING_TIME) / CROSSING_TIME
    n_vehicles = np.clip(n_vehicles, config.vehicles_min, config.vehicles_max)
    duration = n_vehicles * CROSSING_TIME / in_view - CROSSING_TIME
    truck_share = rng.permutation(
        _quantiles(level, config.truck_share_min, config.truck_share_mean, config.truck_share_max, 2.2)
    )
    # Congested recordings have dense traffic, but not the densest, because congestion multiplies the vehicles in view.
    last = round(CONGESTED_LEVEL * N_CELLS)
    congested = (cell >= last - round(config.congested_share * N_CELLS)) & (cell < last)
    section = _choose_sections(in_view, rng)
    order = rng.permutation(N_CELLS)
    rate = n_vehicles / (duration + CROSSING_TIME)
    return _Design(duration[order], rate[order], truck_share[order], congested[order], section[order])


def _quantiles(level: np.ndarray, low: float, mean: float, high: float, concentration: float) -> np.ndarray:
    """Quantiles of a beta distribution stretched over [low, high] with the given mean."""
    centre = (mean - low) / (high - low)
    return low + (high - low) * beta.ppf(level, concentration * centre, concentration * (1.0 - centre))


def _choose_sections(in_view: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Index into SECTIONS for every cell; two-lane places only where the traffic fits."""
    two_lanes = [i for i, section in enumerate(SECTIONS) if section.n_lanes == 2]
    three_lanes = [i for i, section in enumerate(SECTIONS) if section.n_lanes > 2]
    narrow = (in_view <= TWO_LANE_MAX_IN_VIEW) & (rng.random(len(in_view)) < 0.7)
    return np.where(narrow, rng.choice(two_lanes, len(in_view)), rng.choice(three_lanes, len(in_view)))


def _bottleneck(config: GeneratorConfig, direction: int, duration: float, rng: np.random.Generator) -> SpeedRestriction:
    """A bottleneck behind the view that alternates for a while between crawling and slow traffic."""
    time = WARM_UP + duration * float(rng.uniform(0.0, 1.0 - CONGESTED_TIME))
    end = time + CONGESTED_TIME * duration
    times, speeds = [], []
    while time < end:
        times += [time, time + float(rng.uniform(*CRAWL_TIME))]
        speeds += [float(rng.uniform(*CRAWL_SPEED)), float(rng.uniform(*SLOW_SPEED))]
        time = times[-1] + float(rng.uniform(*SLOW_TIME))
    start = config.approach_length + config.camera_length + BOTTLENECK_DISTANCE
    return SpeedRestriction(direction, start, start + BOTTLENECK_LENGTH, (*times, time), (*speeds, float("inf")))

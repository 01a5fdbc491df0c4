"""Arrivals of generated vehicles at the start of the road: time and lane of each vehicle."""

from dataclasses import dataclass

import numpy as np

from rearl_jax.data.generator.plan import RecordingPlan
from rearl_jax.data.generator.road import LOWER, UPPER

MIN_HEADWAY = 1.0  # shortest headway at entry [s]
# Share of the cars per lane, left to right, and share of the trucks in the rightmost lane (the others one
# lane further left). Fitted: with these the cars reach highD's speeds with highD's few lane changes.
CAR_LANE_SHARES = {2: (0.66, 0.34), 3: (0.44, 0.45, 0.11)}
TRUCK_RIGHT_SHARE = 0.95
# Mean of the cars' pace (see Arrivals) per lane, left to right, and its spread within a lane: fast drivers are
# found further left.
# Chosen so that pace is about standard normal over all cars.
LANE_PACE = {2: (0.75, -0.80), 3: (1.10, -0.20, -1.40)}
PACE_SD = 0.5


@dataclass(frozen=True)
class Arrivals:
    """Vehicles in the order of arrival; arrays over vehicles.

    Attributes:
        time: Earliest time of entry [s].
        direction: Carriageway, 1 or 2.
        lane: Lane of entry, 0 = leftmost.
        is_truck: Class.
        pace: Desired speed relative to the mean of the class, in its standard deviations [-].
    """

    time: np.ndarray
    direction: np.ndarray
    lane: np.ndarray
    is_truck: np.ndarray
    pace: np.ndarray


def draw_arrivals(plan: RecordingPlan, end: float, rng: np.random.Generator) -> Arrivals:
    """Arrivals until the given time [s].

    Headways in a lane are a constant plus an exponential part, h = h_min + Exp(1/q - h_min) with flow q per lane. At
    high flow the constant is at most 0.6/q, so that the mean headway stays 1/q.

    Source: shifted exponential headways, Cowan (1975), model M2.
    """
    n_lanes = plan.section.n_lanes
    parts = []
    for direction in (UPPER, LOWER):
        cars = np.asarray(CAR_LANE_SHARES[n_lanes]) * (1.0 - plan.truck_share)
        trucks = np.zeros(n_lanes)
        trucks[-2:] = plan.truck_share * (1.0 - TRUCK_RIGHT_SHARE), plan.truck_share * TRUCK_RIGHT_SHARE
        for lane in range(n_lanes):
            flow = plan.flow(direction) * (cars[lane] + trucks[lane])
            constant = min(MIN_HEADWAY, 0.6 / flow)
            n = int(1.5 * end * flow) + 20
            time = np.cumsum(constant + rng.exponential(1.0 / flow - constant, n))
            time = time[time < end]
            is_truck = rng.random(len(time)) < trucks[lane] / (cars[lane] + trucks[lane])
            draw = np.clip(rng.standard_normal(len(time)), -2.5, 2.5)
            pace = np.where(is_truck, draw, LANE_PACE[n_lanes][lane] + PACE_SD * draw)
            parts.append((time, np.full(len(time), direction), np.full(len(time), lane), is_truck, pace))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return Arrivals(*(column[order] for column in columns))

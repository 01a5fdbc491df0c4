"""Variables of a template for one second of the traffic, as plain numbers and words, from NumPy arrays.

Fields of these records are the names in templates.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Int

from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import nearest_level
from rearl_jax.decision.execution import MAX_SINCE_LANE_CHANGE
from rearl_jax.decision.situation import ACTION_NAMES, Situation
from rearl_jax.detection.detector import Thresholds
from rearl_jax.detection.table import ReferenceTable
from rearl_jax.llm.surroundings import PLACES, Surroundings


class Road(NamedTuple):
    """The road; width in m, limit in m/s or None."""

    n_lanes: int
    lane_width: float
    speed_limit: float | None
    n_cars: int


class Bins(NamedTuple):
    """Speed bins of `Scene.shares`: their range [m/s], their number and the window they are filled in [s]."""

    low: float
    high: float
    number: int
    window: int


class ReferenceCar(NamedTuple):
    """A vehicle of the reference: speed [m/s], mean distance to the others [m], its action in the following second."""

    speed: float
    distance: float
    next: str


class Reference(NamedTuple):
    """One second of a reference; mean distance over all pairs [m]."""

    second: int
    mean_distance: float
    cars: list[ReferenceCar]


class Share(NamedTuple):
    """Share of the speeds in one bin [%]."""

    simulated: float
    recorded: float


class Error(NamedTuple):
    """A deviation from the reference and its threshold [%]; `exceeded` if the deviation is larger."""

    error: float
    threshold: float
    exceeded: bool


class Scene(NamedTuple):
    """A scenario as a whole; mean distance over all pairs [m]."""

    shares: list[Share]
    mean_distance: float
    speeds: Error
    spacing: Error


class Car(NamedTuple):
    """The vehicle of the question: speed [m/s], acceleration [m/s^2], mean distance to the others [m].

    Ranks count from the highest value; equal values share the better rank. `last_action` is None without an action in
    the last second, `since_lane_change` [s] None without a lane change so far.
    """

    vehicle: int
    lane: int
    target_lane: int
    speed: float
    level: int
    acceleration: float
    distance: float
    speed_rank: int
    distance_rank: int
    last_action: str | None
    since_lane_change: int | None


class Neighbour(NamedTuple):
    """The nearest vehicle at one of the `PLACES` around a vehicle; None if there is none.

    Gap bumper to bumper [m], negative side by side; speed, and speed relative to the vehicle [m/s].
    """

    place: str
    gap: float | None
    speed: float | None
    relative_speed: float | None


class Asked(NamedTuple):
    """Rows and columns of the vehicles with a question."""

    vehicle: Int[np.ndarray, " asked"]
    scenario: Int[np.ndarray, " asked"]


def reference_at(table: ReferenceTable, second: int, number: int) -> Reference:
    """One second of a reference."""
    columns = (np.asarray(values)[second, :, number] for values in (table.speed, table.spacing, table.action))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    cars = [ReferenceCar(speed, distance, ACTION_NAMES[action]) for speed, distance, action in rows]
    return Reference(second, float(table.mean_spacing[second, number]), cars)


def scene_of(
    situation: Situation,
    thresholds: Thresholds,
    simulated: Int[np.ndarray, " bins"],
    recorded: Int[np.ndarray, " bins"],
    scenario: int,
) -> Scene:
    """A scenario as a whole."""
    detection = situation.detection
    shares = ((100 * counts / max(counts.sum(), 1)).tolist() for counts in (simulated, recorded))

    def error(value: ArrayLike, threshold: ArrayLike, exceeded: ArrayLike) -> Error:
        percent, limit = (100 * float(np.asarray(share)[scenario]) for share in (value, threshold))
        return Error(percent, limit, bool(np.asarray(exceeded)[scenario]))

    return Scene(
        shares=[Share(*both) for both in zip(*shares, strict=True)],
        mean_distance=float(detection.mean_spacing[scenario]),
        speeds=error(detection.hellinger, thresholds.hellinger, detection.speed_exceeded),
        spacing=error(detection.mape, thresholds.mape, detection.spacing_exceeded),
    )


def cars_of(situation: Situation, asked: Asked, model: TrafficModel) -> Iterator[Car]:
    """The vehicles that questions are about."""
    frame, spacing = situation.frame, situation.detection.spacing

    def of_asked(values: ArrayLike) -> list:
        return np.asarray(values)[asked].tolist()

    return map(
        Car,
        asked.vehicle.tolist(),
        of_asked(frame.lane),
        of_asked(situation.target_lane),
        of_asked(frame.speed),
        of_asked(np.asarray(nearest_level(frame.speed, model)).astype(int)),
        of_asked(frame.acceleration),
        of_asked(spacing),
        ranks(frame.speed, asked).tolist(),
        ranks(spacing, asked).tolist(),
        [None if action < 0 else ACTION_NAMES[action] for action in of_asked(situation.last_action)],
        [None if seconds >= MAX_SINCE_LANE_CHANGE else seconds for seconds in of_asked(situation.since_lane_change)],
    )


def ranks(values: ArrayLike, asked: Asked) -> Int[np.ndarray, " asked"]:
    """Rank of each vehicle with a question in its scenario, 1 for the highest value."""
    values = np.asarray(values)
    value, rank = values[asked], np.ones(len(asked.vehicle), int)
    for other in values:
        rank += other[asked.scenario] > value
    return rank


def neighbours_of(around: Surroundings) -> Iterator[tuple[Neighbour, ...]]:
    """The places around each vehicle."""
    at_places = []
    for place, *columns in zip(PLACES, around.gap, around.speed, around.relative_speed, strict=True):
        is_there = np.isfinite(columns[0]).tolist()
        rows = zip(is_there, *(column.tolist() for column in columns), strict=True)
        no_vehicle = Neighbour(place, None, None, None)
        at_places.append([Neighbour(place, *numbers) if there else no_vehicle for there, *numbers in rows])
    return zip(*at_places, strict=True)

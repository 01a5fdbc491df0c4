"""Opportunities to change lanes: twice a second, for every driver and side with enough room, and whether a change
follows.

An opportunity is left out if the gain of a change is unknown: no vehicle is seen ahead on the own or the target lane
(the leader may be outside the recorded area), the space behind is not recorded, or a lane exists on part of the road
only (changes are mandatory there). These criteria use only what is seen before the decision, so they do not bias the
result.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from rearl_jax.core.effects.stimulus import OUT_OF_SIGHT
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.records import Recording
from rearl_jax.discovery.lane_changes.incentives import KnownDrivers, acceleration, likely_parameters
from rearl_jax.discovery.lane_changes.motion import with_motion
from rearl_jax.discovery.lane_changes.ramps import side_of_ramp, whole_lanes
from rearl_jax.discovery.read.reading import one_frame_rate
from rearl_jax.discovery.read.smoothing import thinned
from rearl_jax.discovery.read.surroundings import SortedLanes

PERIOD = 0.5
"""Time from one opportunity to the next [s], rounded to whole time steps of the recording."""

REST = 6.0
"""Time from the beginning of a lane change during which there are no opportunities [s]."""

LEAST_GAP = 3.0
"""Smallest gap ahead and behind on the target lane [m]."""

HARDEST = 2.0
"""Largest deceleration that a change may require of the driver or of the new follower [m/s^2]. Source: default safe
deceleration of MOBIL, as in the simulation; a change that requires more is refused whatever its gain.
"""

SLOWEST = 3.0
"""Speed below which lane changes are not counted as discretionary [m/s]."""

EARLIER = 2.0
"""Time before an opportunity at which the braking of others is evaluated [s]. Later it may be the response to the lane
change: where no lateral position is recorded a change may begin 1.5 s earlier than assumed (it lasts up to 7 s), and
smoothing spreads braking half a second back in time. Source of the duration: Toledo & Zohar, Transp. Res. Rec. 1999
(2007) 71.
"""

SEEN_BEHIND = 60.0
"""Length of road behind that must be recorded if no follower is seen there [m]."""


@dataclass(frozen=True)
class Opportunities:
    """One row per opportunity: the driver, the own lane, and the lane on one side.

    Attributes:
        vehicle: Number of the vehicle, unique over the recordings, as in `Measured.vehicle`.
        recording: Index of the recording.
        frame: Frame of the opportunity.
        side: -1 to the left, +1 to the right.
        period: Time to the next opportunity [s].
        changes: Whether the driver begins to change to that side within this time.
        incentive: Own acceleration gained [m/s^2].
        rear_after: Acceleration of the new follower after the change, with its own parameters [m/s^2]; 0 without a new
            follower.
        rear_gain: Acceleration gained by the new follower, with its own parameters [m/s^2]; negative for a loss.
        follower_gain: Acceleration gained by the present follower [m/s^2].
        speed: Own speed [m/s].
        gap, leader_speed, leader_is_truck: Gap [m], speed [m/s] and class of the leader on the own lane.
        side_gap, side_leader_speed, side_leader_is_truck: Gap, speed and class of the leader on the target lane.
        rear_gap: Gap to the new follower [m]; OUT_OF_SIGHT if there is none.
        rear_braking: Acceleration of the model of the new follower behind its leader, minus its measured acceleration,
            both EARLIER seconds before [m/s^2]; 0 without a new follower.
        follower_gap, follower_speed: Gap and speed of the present follower; OUT_OF_SIGHT and the own speed if none.
        is_truck: Whether the own vehicle is a truck.
        is_mandatory: Whether the vehicle later reaches a ramp lane on that side. This uses the future, so it only
            classifies opportunities and is never used to predict.
    """

    vehicle: Int[np.ndarray, " rows"]
    recording: Int[np.ndarray, " rows"]
    frame: Int[np.ndarray, " rows"]
    side: Int[np.ndarray, " rows"]
    period: Float[np.ndarray, " rows"]
    changes: Bool[np.ndarray, " rows"]
    incentive: Float[np.ndarray, " rows"]
    rear_after: Float[np.ndarray, " rows"]
    rear_gain: Float[np.ndarray, " rows"]
    follower_gain: Float[np.ndarray, " rows"]
    speed: Float[np.ndarray, " rows"]
    gap: Float[np.ndarray, " rows"]
    leader_speed: Float[np.ndarray, " rows"]
    leader_is_truck: Bool[np.ndarray, " rows"]
    side_gap: Float[np.ndarray, " rows"]
    side_leader_speed: Float[np.ndarray, " rows"]
    side_leader_is_truck: Bool[np.ndarray, " rows"]
    rear_gap: Float[np.ndarray, " rows"]
    rear_braking: Float[np.ndarray, " rows"]
    follower_gap: Float[np.ndarray, " rows"]
    follower_speed: Float[np.ndarray, " rows"]
    is_truck: Bool[np.ndarray, " rows"]
    is_mandatory: Bool[np.ndarray, " rows"]

    def take(self, rows: np.ndarray) -> "Opportunities":
        """The given rows."""
        return Opportunities(**{name: getattr(self, name)[rows] for name in _NAMES})


_NAMES = tuple(Opportunities.__dataclass_fields__)


def opportunities(recordings: Sequence[Recording], drivers: KnownDrivers) -> tuple[Opportunities, str]:
    """All opportunities of the recordings, and the reason why there are none, or "". The vehicles of `drivers` have the
    numbers that `measured_drivers` gives to those of these recordings.

    Raises:
        ValueError: The frame rates differ.
    """
    if not recordings:
        return _empty(), ""
    rate = one_frame_rate(recordings)
    parts, reasons, first_vehicle = [], [], 0
    for index, recording in enumerate(recordings):
        table, dt = thinned(recording, rate)
        part, reason = _of_recording(table, dt, first_vehicle, index, drivers)
        parts, reasons = [*parts, part], [*reasons, reason]
        first_vehicle += int(table["track_id"].to_numpy().max(initial=-1)) + 1
    joined = _joined(parts)
    return joined, "" if len(joined.side) else reasons[0]


def _of_recording(
    table: pd.DataFrame, dt: float, first_vehicle: int, recording: int, drivers: KnownDrivers
) -> tuple[Opportunities, str]:
    """Opportunities of one recording, and the reason why there are none, or ""; `first_vehicle` is the number of the
    vehicle with track 0, `recording` the index of the recording.
    """
    if not table["lane"].notna().to_numpy().any():
        return _empty(), "the data have no lanes"
    moving, period = with_motion(table, dt), max(1, round(PERIOD / dt))
    is_used = moving["frame"].to_numpy() % period == 0
    rows = moving.iloc[np.flatnonzero(moving["lane"].notna().to_numpy() & is_used)].reset_index(drop=True)
    lanes = np.stack([rows["direction"].to_numpy(np.int64), rows["lane"].to_numpy(np.int64)])
    if np.bincount(np.unique(lanes, axis=1)[0]).max(initial=0) < 2:
        return _empty(), "there is one lane per direction"
    scene = _Scene(rows, drivers, first_vehicle, recording, period, dt)
    joined = _joined([scene.side(side) for side in (-1, 1)])
    reason = "" if len(joined.side) else "no driver has leaders on the own and on an adjacent lane, and room to change"
    return joined, reason


class _Scene:
    """The rows of one recording in the frames of opportunities, `period` frames of `dt` [s] apart."""

    def __init__(
        self, rows: pd.DataFrame, drivers: KnownDrivers, first_vehicle: int, recording: int, period: int, dt: float
    ) -> None:
        self.period = period * dt
        self.vehicle, self.recording = rows["track_id"].to_numpy().astype(np.int64) + first_vehicle, recording
        self.is_truck = (rows["vehicle_class"] == "truck").to_numpy()
        motion = (rows[name].to_numpy() for name in ("position", "speed", "acceleration", "length"))
        self.x, self.v, self.a, self.length = motion
        times = (rows[name].to_numpy() for name in ("since_change", "to_change", "time_to_track_end"))
        self.since_change, self.to_change, self.time_to_track_end = times
        self.next_step = rows["next_step"].to_numpy()  # change of the lane number at the next lane change
        self.lane, self.direction = rows["lane"].to_numpy(np.int64), rows["direction"].to_numpy(np.int64)
        self.upstream = rows.groupby("direction")["position"].transform("min").to_numpy()
        self.through_lanes = whole_lanes(self.direction, self.lane, self.x)
        self.frame = rows["frame"].to_numpy(np.int64)
        self.ramp_side = side_of_ramp(self.vehicle, self.direction, self.lane, self.through_lanes)
        self.continues = _continues(rows, period)
        self.model = drivers.prior.name
        self.lanes = SortedLanes(rows)
        self.leader, self.follower = self.lanes.ahead(0), self.lanes.behind(0)
        self.own = self._parameters(drivers)
        self.braking = self._earlier_braking()

    def _parameters(self, drivers: KnownDrivers) -> np.ndarray:
        """Parameters of every row's driver: calibrated ones, else those of `likely_parameters`."""
        own = drivers.of_vehicles(self.vehicle, self.is_truck)
        driver = np.unique(self.vehicle, return_inverse=True)[1]
        gap = self._gap(np.arange(len(driver)), self.leader)
        motion = (self.v, gap, self.v[self.leader], self.a, self.leader != NO_VEHICLE)
        likely = likely_parameters(own, driver, *motion, self.period, drivers.prior)
        return np.where(drivers.is_known(self.vehicle), own, likely)

    def _earlier_braking(self) -> np.ndarray:
        """Acceleration of each vehicle's model behind its leader, minus its measured acceleration, both EARLIER seconds
        before [m/s^2]; 0 if unknown.
        """
        row = np.arange(len(self.leader))
        braking = np.where(self.leader == NO_VEHICLE, 0.0, self._behind(row, self.leader) - self.a)
        n_before = round(EARLIER / self.period)
        earlier = np.maximum(row - n_before, 0)
        n_breaks = np.cumsum(~self.continues)  # equal in two rows if the record is uninterrupted between them
        is_known = (row >= n_before) & (n_breaks[row] == n_breaks[earlier])
        return np.where(is_known, braking[earlier], 0.0)

    def side(self, side: int) -> Opportunities:
        """Opportunities to change to one side, from the neighbours on the own lane and on the target lane."""
        leader, follower = self.leader, self.follower
        side_leader, rear = self.lanes.ahead(side), self.lanes.behind(side)
        chosen = np.flatnonzero(self._may_change(side) & (leader != NO_VEHICLE) & (side_leader != NO_VEHICLE))
        near_edge = self.x[chosen] - self.upstream[chosen] < SEEN_BEHIND
        chosen = chosen[~near_edge | ((rear[chosen] != NO_VEHICLE) & (follower[chosen] != NO_VEHICLE))]
        leader, follower, side_leader, rear = (rows[chosen] for rows in (leader, follower, side_leader, rear))
        v = self.v[chosen]
        gap, side_gap = self._gap(chosen, leader), self._gap(chosen, side_leader)
        rear_gap, follower_gap = self._gap(rear, chosen), self._gap(follower, chosen)
        stays, changed = self._behind(chosen, leader), self._behind(chosen, side_leader)
        rear_after, rear_before = self._behind(rear, chosen), self._behind(rear, side_leader)
        fits = (side_gap > LEAST_GAP) & (rear_gap > LEAST_GAP) & (changed > -HARDEST) & (rear_after > -HARDEST)
        options = Opportunities(
            vehicle=self.vehicle[chosen],
            recording=np.full(len(chosen), self.recording),
            frame=self.frame[chosen],
            side=np.full(len(chosen), side),
            period=np.full(len(chosen), self.period),
            changes=(self.to_change[chosen] <= self.period + 1e-9) & (self.next_step[chosen] == side),
            incentive=changed - stays,
            rear_after=rear_after,
            rear_gain=rear_after - rear_before,
            follower_gain=self._behind(follower, leader) - self._behind(follower, chosen),
            speed=v,
            gap=gap,
            leader_speed=self.v[leader],
            leader_is_truck=self.is_truck[leader],
            side_gap=side_gap,
            side_leader_speed=self.v[side_leader],
            side_leader_is_truck=self.is_truck[side_leader],
            rear_gap=rear_gap,
            rear_braking=np.where(rear == NO_VEHICLE, 0.0, self.braking[rear]),
            follower_gap=follower_gap,
            follower_speed=np.where(follower == NO_VEHICLE, v, self.v[follower]),
            is_truck=self.is_truck[chosen],
            is_mandatory=self.ramp_side[chosen] == side,
        )
        return options.take(np.flatnonzero(fits))

    def _may_change(self, side: int) -> np.ndarray:
        """True for drivers on a through lane with a through lane on that side who began no lane change within REST."""
        has_lanes = np.zeros(len(self.x), bool)
        for direction, lane in self.through_lanes:
            if (direction, lane + side) in self.through_lanes:
                has_lanes |= (self.direction == direction) & (self.lane == lane)
        is_seen = self.time_to_track_end >= self.period - 1e-9
        return has_lanes & (self.since_change >= REST) & is_seen & (self.v > SLOWEST)

    def _gap(self, behind: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Bumper-to-bumper gap [m]; OUT_OF_SIGHT if one of the two vehicles is missing."""
        gap = self.x[front] - self.x[behind] - (self.length[front] + self.length[behind]) / 2
        return np.where((behind == NO_VEHICLE) | (front == NO_VEHICLE), OUT_OF_SIGHT, gap)

    def _behind(self, vehicles: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Model acceleration of vehicles behind given leaders [m/s^2]; 0 without a vehicle."""
        gap, is_led = self._gap(vehicles, front), front != NO_VEHICLE
        value = acceleration(self.model, self.own[:, vehicles], self.v[vehicles], gap, self.v[front], is_led)
        return np.where(vehicles == NO_VEHICLE, 0.0, value)


def _continues(rows: pd.DataFrame, period: int) -> Bool[np.ndarray, " rows"]:
    """True if the row before is that of the same vehicle, `period` frames earlier."""
    track, frame = rows["track_id"].to_numpy(), rows["frame"].to_numpy()
    return np.r_[False, (track[1:] == track[:-1]) & (frame[1:] == frame[:-1] + period)]


def _empty() -> Opportunities:
    kinds: dict[str, type] = dict.fromkeys(("vehicle", "recording", "frame", "side"), int)
    kinds |= dict.fromkeys(("changes", "is_truck", "leader_is_truck", "side_leader_is_truck", "is_mandatory"), bool)
    return Opportunities(**{name: np.empty(0, kinds.get(name, float)) for name in _NAMES})


def _joined(parts: Sequence[Opportunities]) -> Opportunities:
    return Opportunities(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in _NAMES})

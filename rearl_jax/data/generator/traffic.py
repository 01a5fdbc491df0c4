"""Simulation of one recording's traffic on the whole road; returns the traffic that passes the camera.

Each time step sorts the vehicles by lane, admits new ones, determines the situation of every driver, chooses lanes and
accelerations, and moves the vehicles.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator.car_following import chosen_acceleration, safe_speed
from rearl_jax.data.generator.demand import Arrivals
from rearl_jax.data.generator.fleet import Drivers, Fleet, Situation
from rearl_jax.data.generator.lane_changing import (
    LEFT,
    PAUSE,
    RIGHT,
    Neighbours,
    accepts_gaps,
    change_probability,
    has_left_origin,
    lateral_position,
)
from rearl_jax.data.generator.plan import EXIT_LENGTH, WARM_UP, RecordingPlan

FRAME = 0.04  # time between two frames [s]
DECISION_INTERVAL = 0.4  # time between two lane-change decisions [s]; each is about one side, and sides alternate
NOISE_TIME = 1.5  # correlation time of the acceleration noise [s]; Zhang and Sun (2022) on highD
FULL_NOISE_SPEED = 10.0  # below this speed the acceleration noise falls in proportion to the speed [m/s]; assumed
HARD_BRAKING = 2.5  # deceleration from which there is no acceleration noise [m/s^2]; assumed
LATERAL_TARGET_SD = 0.15  # standard deviation of the lateral offset that a driver aims at [m]; assumed
LATERAL_TARGET_TIME = 6.0  # its correlation time [s]; assumed
STEER_TIME = 1.5  # time constant with which the lateral offset follows its target [s]; assumed
ENTRY_HORIZON = 15.0  # time within which an entering driver would close a larger gap than wanted [s]; assumed
UNCHANGED_LENGTH = 100.0  # length at both ends of the road on which no lane change begins [m]; assumed
# The tracker smooths over the edges of view and recording, so it needs samples beyond both.
CAMERA_MARGIN = 30.0  # road sampled before and after the view [m]
TIME_MARGIN = 1.0  # time sampled before and after the recording [s]
LANE_KEY_OFFSET = 1.0e5  # difference between the sort keys of two lanes, longer than any road [m]
LANE_IDS = 16  # lane ids per direction, more than there are lanes


@dataclass(frozen=True)
class Samples:
    """Traffic that passes the camera, one row per vehicle and simulation step, sorted by vehicle and step.

    Attributes:
        vehicle: Number of the vehicle.
        step: Simulation step; step 0 is the first frame of the recording.
        position: Vehicle centre from the upstream edge of the view [m].
        speed: [m/s].
        lateral: Vehicle centre from the left edge of the carriageway [m].
    """

    vehicle: np.ndarray
    step: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    lateral: np.ndarray


class Traffic:
    """Traffic of one recording, advanced step by step."""

    def __init__(
        self,
        plan: RecordingPlan,
        config: GeneratorConfig,
        arrivals: Arrivals,
        drivers: Drivers,
        rng: np.random.Generator,
    ):
        self.plan, self.config = plan, config
        self.arrivals, self.drivers, self.rng = arrivals, drivers, rng
        self.fleet = Fleet.empty(drivers)
        self.time = 0.0
        self.dt = FRAME * config.frames_per_step
        self.road_length = config.approach_length + config.camera_length + EXIT_LENGTH
        self.side = LEFT
        self.next_decision = 0.0
        self.entry_lane_id = _lane_id(arrivals.lane, arrivals.direction)
        self.queues = _queues_per_lane(arrivals)
        self.next_entry_time = np.array([arrivals.time[queue[0]] for queue in self.queues])

    def record(self) -> Samples:
        """Run the warm-up and the recording."""
        sampling_start = WARM_UP - TIME_MARGIN
        n_steps = int(np.ceil((WARM_UP + self.plan.duration + TIME_MARGIN) / self.dt)) + 1
        recording_step = round(WARM_UP / self.dt)
        rows = []
        for step in range(n_steps):
            self.time = step * self.dt
            self.order()
            self.admit()
            if self.time >= sampling_start:
                rows.append(self._in_view(step - recording_step))
            situation, desired_speed = self.perceive()
            self.choose_lanes(situation, desired_speed)
            self.choose_accelerations(situation, desired_speed)
            self.move()
        vehicle, steps, position, speed, lateral = (np.concatenate(column) for column in zip(*rows, strict=True))
        index = np.lexsort((steps, vehicle))
        return Samples(vehicle[index], steps[index], position[index], speed[index], lateral[index])

    def order(self) -> None:
        """Sort the vehicles by lane and position, and find their leaders.

        A vehicle that changes lanes is listed twice, in its target lane and in its lane of origin, until it has left
        that lane. Sets `changing`, the vehicles listed twice; `keys`, `vehicle_at` and `lane_at`, sort key, vehicle and
        lane id of every entry, in the order of the keys; `leader` of every vehicle and, in the lane of origin,
        `leader_in_origin` of every vehicle of `changing` (-1 = none).

        Raises:
            RuntimeError: Two vehicles overlap, which is an error of the driver model.
        """
        fleet = self.fleet
        n = len(fleet)
        self.changing = np.flatnonzero(fleet.origin >= 0)
        vehicle = np.concatenate([np.arange(n), self.changing])
        lane_id = _lane_id(np.concatenate([fleet.lane, fleet.origin[self.changing]]), fleet.direction[vehicle])
        key = lane_id * LANE_KEY_OFFSET + fleet.position[vehicle]
        index = np.argsort(key, kind="stable")
        self.keys, self.vehicle_at, self.lane_at = key[index], vehicle[index], lane_id[index]
        has_next = self.lane_at[1:] == self.lane_at[:-1]
        ahead = self.vehicle_at[1:]
        gaps = fleet.position[ahead] - fleet.drivers.length[ahead] - fleet.position[self.vehicle_at[:-1]]
        if np.any(gaps[has_next] <= 0.0):
            raise RuntimeError(
                f"recording {self.plan.id}: two generated vehicles overlap at {self.time:.2f} s; "
                "the driver parameters allow collisions, use larger time gaps or a smaller step"
            )
        leader = np.full(len(vehicle), -1)
        leader[index[:-1][has_next]] = ahead[has_next]
        self.leader, self.leader_in_origin = leader[:n], leader[n:]

    def admit(self) -> None:
        """Let the next vehicle of every lane enter once its time has come and the gap is large enough."""
        entered = []
        for number in np.flatnonzero(self.next_entry_time <= self.time):
            queue = self.queues[number]
            entry = self._entry(queue[0])
            if entry is not None:
                entered.append(entry)
                queue.pop(0)
                self.next_entry_time[number] = self.arrivals.time[queue[0]] if queue else np.inf
        if not entered:
            return
        vehicle, position, speed = (np.array(column) for column in zip(*entered, strict=True))
        self.fleet.enter(
            self.drivers,
            vehicle=vehicle,
            direction=self.arrivals.direction[vehicle],
            lane=self.arrivals.lane[vehicle],
            origin=np.full(len(vehicle), -1),
            position=position,
            speed=speed,
            noise=self.config.acceleration_noise * self.rng.standard_normal(len(vehicle)),
            ready_time=np.full(len(vehicle), self.time + PAUSE),
        )
        self.order()

    def _entry(self, vehicle: int) -> tuple[int, float, float] | None:
        """Number, position and speed of a vehicle that enters its lane; None while there is no room."""
        arrivals, drivers = self.arrivals, self.drivers
        lane_id = self.entry_lane_id[vehicle]
        desired = drivers.desired_speed[vehicle]
        rearmost = int(np.searchsorted(self.keys, lane_id * LANE_KEY_OFFSET))
        late = self.time - arrivals.time[vehicle]
        if rearmost == len(self.keys) or self.lane_at[rearmost] != lane_id:
            return vehicle, float(min(late, self.dt) * desired), float(desired)
        leader = self.vehicle_at[rearmost]
        leader_speed = self.fleet.speed[leader]
        gap = self.fleet.position[leader] - self.fleet.drivers.length[leader]
        room = max(gap - drivers.time_gap[vehicle] * leader_speed, 0.0)
        speed = min(desired, leader_speed + room / ENTRY_HORIZON)
        position = min(min(late, self.dt) * speed, gap)
        if gap - position < drivers.jam_gap[vehicle] + drivers.critical_gap[vehicle] * speed:
            return None
        return vehicle, float(position), float(speed)

    def perceive(self) -> tuple[Situation, np.ndarray]:
        """The situation of every driver, and the desired speed in it [m/s]."""
        fleet = self.fleet
        leader = self.leader.copy()
        gap, leader_speed = self._gap_and_speed(leader, np.arange(len(fleet)))
        if len(self.changing):
            # A driver who occupies two lanes follows the leader that allows the lower speed.
            other = self.leader_in_origin
            other_gap, other_speed = self._gap_and_speed(other, self.changing)
            speed, drivers = fleet.speed[self.changing], fleet.drivers.take(self.changing)
            safe = safe_speed(speed, gap[self.changing], leader_speed[self.changing], drivers)
            lower = safe_speed(speed, other_gap, other_speed, drivers) < safe
            vehicle = self.changing[lower]
            leader[vehicle], gap[vehicle], leader_speed[vehicle] = other[lower], other_gap[lower], other_speed[lower]
        leader_acceleration = np.where(leader >= 0, fleet.acceleration[leader], 0.0)
        situation = Situation(self.time, fleet, gap, leader_speed, leader_acceleration)
        desired_speed = fleet.drivers.desired_speed
        if self.plan.congestion is not None:
            desired_speed = self.plan.congestion.limited(desired_speed, situation)
        return situation, desired_speed

    def choose_lanes(self, situation: Situation, desired_speed: np.ndarray) -> None:
        """Begin lane changes to one side; sides alternate, so that no two vehicles meet in one lane."""
        if self.time < self.next_decision:
            return
        self.next_decision += DECISION_INTERVAL
        side = self.side
        self.side = RIGHT if side == LEFT else LEFT
        fleet, n_lanes = self.fleet, self.plan.section.n_lanes
        target_lane = fleet.lane + side
        leftmost = np.where(fleet.drivers.is_truck & (n_lanes > 2), 1, 0)
        allowed = (
            (target_lane >= leftmost)
            & (target_lane < n_lanes)
            & ~fleet.is_moving_over
            & (fleet.ready_time <= self.time)
            & (fleet.position > UNCHANGED_LENGTH)
            & (fleet.position < self.road_length - UNCHANGED_LENGTH)
        )
        if not np.any(allowed):
            return
        target = self._neighbours(target_lane)
        rate = self.config.lane_change_rate
        probability = change_probability(side, situation, target, desired_speed, rate, 2 * DECISION_INTERVAL)
        draw = self.rng.random(len(fleet))
        starting = np.flatnonzero(allowed & (draw < probability) & accepts_gaps(fleet.speed, target, fleet.drivers))
        fleet.origin[starting] = fleet.lane[starting]
        fleet.lane[starting] += side
        fleet.change_start[starting] = self.time
        fleet.change_shift[starting] = -side * self.plan.section.lane_width

    def choose_accelerations(self, situation: Situation, desired_speed: np.ndarray) -> None:
        """Set the acceleration of every vehicle, car following plus noise, and its lateral target."""
        fleet = self.fleet
        acceleration = chosen_acceleration(
            fleet.speed,
            desired_speed,
            situation.gap,
            situation.leader_speed,
            situation.leader_acceleration,
            fleet.drivers,
        )
        kept = np.exp(-self.dt / NOISE_TIME)
        shocks = self.rng.standard_normal((2, len(fleet)))
        fleet.noise = kept * fleet.noise + self.config.acceleration_noise * np.sqrt(1.0 - kept**2) * shocks[0]
        noise_scale = np.minimum(fleet.speed / FULL_NOISE_SPEED, 1.0) * (acceleration > -HARD_BRAKING)
        fleet.acceleration = acceleration + noise_scale * fleet.noise
        kept = np.exp(-self.dt / LATERAL_TARGET_TIME)
        fleet.lateral_target = kept * fleet.lateral_target + LATERAL_TARGET_SD * np.sqrt(1.0 - kept**2) * shocks[1]

    def move(self) -> None:
        """Advance positions and speeds with constant acceleration; no vehicle drives backwards."""
        fleet = self.fleet
        speed = np.maximum(fleet.speed + self.dt * fleet.acceleration, 0.0)
        fleet.position = fleet.position + 0.5 * self.dt * (fleet.speed + speed)
        fleet.speed = speed
        share = self.dt / STEER_TIME
        fleet.lateral_offset = fleet.lateral_offset + share * (fleet.lateral_target - fleet.lateral_offset)
        time = self.time + self.dt
        done = fleet.is_moving_over & (time - fleet.change_start >= fleet.drivers.change_duration)
        fleet.change_shift[done] = 0.0
        fleet.ready_time[done] = time + PAUSE
        if len(self.changing):
            lateral = lateral_position(fleet, time, self.plan.section.lane_width)
            fleet.origin[has_left_origin(fleet, lateral, self.plan.section.lane_width) | done] = -1
        if np.any(fleet.position > self.road_length):
            fleet.keep(self.drivers, fleet.position <= self.road_length)

    def _in_view(self, step: int) -> tuple[np.ndarray, ...]:
        """Columns of `Samples` for the vehicles in the view and near it."""
        fleet = self.fleet
        position = fleet.position - 0.5 * fleet.drivers.length - self.config.approach_length
        index = np.flatnonzero((position > -CAMERA_MARGIN) & (position < self.config.camera_length + CAMERA_MARGIN))
        lateral = lateral_position(fleet, self.time, self.plan.section.lane_width)
        return fleet.vehicle[index], np.full(len(index), step), position[index], fleet.speed[index], lateral[index]

    def _gap_and_speed(self, leader: np.ndarray, follower: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap to each leader [m] and its speed [m/s]; for -1, no leader, inf and the follower's own speed."""
        fleet = self.fleet
        exists = leader >= 0
        gap = np.where(exists, fleet.position[leader] - fleet.drivers.length[leader] - fleet.position[follower], np.inf)
        return gap, np.where(exists, fleet.speed[leader], fleet.speed[follower])

    def _neighbours(self, lane: np.ndarray) -> Neighbours:
        """Leader and follower of every vehicle in another lane of its carriageway."""
        fleet = self.fleet
        lane_id = _lane_id(lane, fleet.direction)
        place = np.searchsorted(self.keys, lane_id * LANE_KEY_OFFSET + fleet.position)
        last = len(self.keys) - 1
        ahead, behind = np.minimum(place, last), np.maximum(place - 1, 0)
        has_ahead = (place <= last) & (self.lane_at[ahead] == lane_id)
        has_behind = (place >= 1) & (self.lane_at[behind] == lane_id)
        leader, follower = self.vehicle_at[ahead], self.vehicle_at[behind]
        length = fleet.drivers.length
        return Neighbours(
            np.where(has_ahead, fleet.position[leader] - length[leader] - fleet.position, np.inf),
            np.where(has_ahead, fleet.speed[leader], fleet.drivers.desired_speed),
            np.where(has_behind, fleet.position - length - fleet.position[follower], np.inf),
            np.where(has_behind, fleet.speed[follower], 0.0),
        )


def _lane_id(lane: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Number of a lane that differs between the two carriageways, for sort keys."""
    return lane + LANE_IDS * direction


def _queues_per_lane(arrivals: Arrivals) -> list[list[int]]:
    """Vehicles that wait for entry, one list per lane of both carriageways, first to come first."""
    lanes = np.unique(np.stack([arrivals.direction, arrivals.lane]), axis=1).T
    return [
        np.flatnonzero((arrivals.direction == direction) & (arrivals.lane == lane)).tolist()
        for direction, lane in lanes
    ]

"""Simulation of one recording's traffic on the whole road; returns what passes the camera.

A step: order the vehicles by lane, let new ones in, see, choose lanes, choose accelerations, move.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator.car_following import chosen_acceleration, safe_speed
from rearl_jax.data.generator.demand import Arrivals
from rearl_jax.data.generator.fleet import Drivers, Fleet
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
from rearl_jax.data.generator.situation import Situation

FRAME = 0.04  # time between two frames [s]
DECISION_INTERVAL = 0.4  # time between two lane-change decisions of a driver and side [s]
NOISE_TIME = 1.5  # correlation time of a driver's own acceleration [s]; Zhang and Sun (2022) on highD
DRIFT_SD, DRIFT_TIME, STEER_TIME = 0.15, 6.0, 1.5  # wandering within the lane [m], [s], [s]; assumed
CAMERA_MARGIN = 30.0  # road simulated for the tracker on both sides of the view [m]
TIME_MARGIN = 1.0  # the same before and after the recording [s]
STRIPE_LENGTH = 1.0e5  # offset between the sort keys of two lanes, longer than any road [m]
STRIPES = 16  # lanes per direction in the sort key, more than there are


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
        self.queues = _queues_per_lane(arrivals)
        self.next_entry = np.array([arrivals.time[queue[0]] for queue in self.queues])

    def record(self) -> Samples:
        """Run the warm-up and the recording."""
        first = WARM_UP - TIME_MARGIN
        n_steps = int(np.ceil((WARM_UP + self.plan.duration + TIME_MARGIN) / self.dt)) + 1
        begin = round(WARM_UP / self.dt)
        rows = []
        for step in range(n_steps):
            self.time = step * self.dt
            self.order()
            self.admit()
            if self.time >= first:
                rows.append(self._in_view(step - begin))
            situation, desired_speed = self.see()
            self.choose_lanes(situation, desired_speed)
            self.choose_accelerations(situation, desired_speed)
            self.move()
        vehicle, steps, position, speed, lateral = (np.concatenate(column) for column in zip(*rows, strict=True))
        index = np.lexsort((steps, vehicle))
        return Samples(vehicle[index], steps[index], position[index], speed[index], lateral[index])

    def order(self) -> None:
        """Sort the vehicles by lane and position; one that changes lanes stands in both lanes.

        Raises:
            RuntimeError: Two vehicles overlap, the driver model is at fault.
        """
        fleet = self.fleet
        between = np.flatnonzero(fleet.origin >= 0)
        self.between = between
        owner = np.concatenate([np.arange(len(fleet)), between])
        stripe = np.concatenate([fleet.lane, fleet.origin[between]]) + STRIPES * fleet.direction[owner]
        key = stripe * STRIPE_LENGTH + fleet.position[owner]
        index = np.argsort(key, kind="stable")
        self.keys, self.owners, self.stripes = key[index], owner[index], stripe[index]
        has_next = self.stripes[1:] == self.stripes[:-1]
        ahead = self.owners[1:]
        gaps = fleet.position[ahead] - fleet.drivers.length[ahead] - fleet.position[self.owners[:-1]]
        if np.any(gaps[has_next] <= 0.0):
            raise RuntimeError(
                f"recording {self.plan.id}: two generated vehicles overlap at {self.time:.2f} s; "
                "the driver parameters allow collisions, use larger time gaps or a smaller step"
            )
        # The leader of every entry; entries beyond len(fleet) are lanes of origin.
        self.leader_of_entry = np.full(len(owner), -1)
        self.leader_of_entry[index[:-1][has_next]] = ahead[has_next]

    def admit(self) -> None:
        """Let the next vehicle of every lane in once its time has come and the gap suffices."""
        entered = []
        for lane_index in np.flatnonzero(self.next_entry <= self.time):
            entry = self._entry(int(lane_index))
            if entry is not None:
                entered.append(entry)
                queue = self.queues[lane_index]
                queue.pop(0)
                self.next_entry[lane_index] = self.arrivals.time[queue[0]] if queue else np.inf
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

    def _entry(self, lane_index: int) -> tuple[int, float, float] | None:
        """Vehicle, position and speed of the next one to enter a lane; None while there is no room."""
        vehicle = self.queues[lane_index][0]
        arrivals, drivers = self.arrivals, self.drivers
        stripe = arrivals.lane[vehicle] + STRIPES * arrivals.direction[vehicle]
        desired = drivers.desired_speed[vehicle]
        last = int(np.searchsorted(self.keys, stripe * STRIPE_LENGTH))
        late = self.time - arrivals.time[vehicle]
        if last == len(self.keys) or self.stripes[last] != stripe:
            return vehicle, float(min(late, self.dt) * desired), float(desired)
        leader = self.owners[last]
        leader_speed = self.fleet.speed[leader]
        gap = self.fleet.position[leader] - self.fleet.drivers.length[leader]
        speed = min(desired, leader_speed + max(gap - drivers.time_gap[vehicle] * leader_speed, 0.0) / 15.0)
        position = min(min(late, self.dt) * speed, gap)
        if gap - position < drivers.jam_gap[vehicle] + drivers.critical_gap[vehicle] * speed:
            return None
        return vehicle, float(position), float(speed)

    def see(self) -> tuple[Situation, np.ndarray]:
        """The situation of every driver and the speed he wants in it."""
        fleet = self.fleet
        n = len(fleet)
        leader = self.leader_of_entry[:n].copy()
        gap, leader_speed = self._to(leader, np.arange(n))
        if len(self.between):
            # Between two lanes a driver follows the leader that allows the lower speed.
            second = self.leader_of_entry[n:]
            second_gap, second_speed = self._to(second, self.between)
            own, drivers = fleet.speed[self.between], fleet.drivers.take(self.between)
            first_safe = safe_speed(own, gap[self.between], leader_speed[self.between], drivers.time_gap, drivers)
            second_safe = safe_speed(own, second_gap, second_speed, drivers.time_gap, drivers)
            lower = second_safe < first_safe
            change = self.between[lower]
            leader[change], gap[change], leader_speed[change] = (
                second[lower],
                second_gap[lower],
                second_speed[lower],
            )
        leader_acceleration = np.where(leader >= 0, fleet.acceleration[leader], 0.0)
        situation = Situation(self.time, fleet, leader, gap, leader_speed, leader_acceleration)
        desired_speed = fleet.drivers.desired_speed
        if self.plan.congestion is not None:
            desired_speed = self.plan.congestion(desired_speed, situation)
        return situation, desired_speed

    def choose_lanes(self, situation: Situation, desired_speed: np.ndarray) -> None:
        """Begin lane changes to one side; left and right alternate, so that two never meet in one lane."""
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
            & (fleet.change_shift == 0.0)
            & (fleet.ready_time <= self.time)
            & (fleet.position > 100.0)
            & (fleet.position < self.road_length - 100.0)
        )
        if not np.any(allowed):
            return
        target = self._neighbours(target_lane)
        rate = self.config.lane_change_rate
        probability = change_probability(side, situation, target, desired_speed, rate, 2 * DECISION_INTERVAL)
        draw = self.rng.random(len(fleet))
        begin = np.flatnonzero(allowed & (draw < probability) & accepts_gaps(fleet.speed, target, fleet.drivers))
        fleet.origin[begin] = fleet.lane[begin]
        fleet.lane[begin] += side
        fleet.change_start[begin] = self.time
        fleet.change_shift[begin] = -side * self.plan.section.lane_width

    def choose_accelerations(self, situation: Situation, desired_speed: np.ndarray) -> None:
        """Set the acceleration of every vehicle: car following plus the driver's own noise."""
        fleet = self.fleet
        acceleration = chosen_acceleration(
            fleet.speed,
            desired_speed,
            situation.gap,
            situation.leader_speed,
            situation.leader_acceleration,
            fleet.drivers.time_gap,
            fleet.drivers,
        )
        kept = np.exp(-self.dt / NOISE_TIME)
        shocks = self.rng.standard_normal((2, len(fleet)))
        fleet.noise = kept * fleet.noise + self.config.acceleration_noise * np.sqrt(1.0 - kept**2) * shocks[0]
        # Near standstill and in an emergency drivers have no noise of their own.
        calm = np.minimum(fleet.speed / 10.0, 1.0) * (acceleration > -2.5)
        fleet.acceleration = acceleration + calm * fleet.noise
        kept = np.exp(-self.dt / DRIFT_TIME)
        fleet.drift = kept * fleet.drift + DRIFT_SD * np.sqrt(1.0 - kept**2) * shocks[1]

    def move(self) -> None:
        """Advance positions and speeds with constant acceleration; no vehicle drives backwards."""
        fleet = self.fleet
        speed = np.maximum(fleet.speed + self.dt * fleet.acceleration, 0.0)
        fleet.position = fleet.position + 0.5 * self.dt * (fleet.speed + speed)
        fleet.speed = speed
        fleet.wander = fleet.wander + (fleet.drift - fleet.wander) * (self.dt / STEER_TIME)
        time = self.time + self.dt
        done = (fleet.change_shift != 0.0) & (time - fleet.change_start >= fleet.drivers.change_duration)
        fleet.change_shift[done] = 0.0
        fleet.ready_time[done] = time + PAUSE
        if len(self.between):
            lateral = lateral_position(fleet, time, self.plan.section.lane_width)
            fleet.origin[has_left_origin(fleet, lateral, self.plan.section.lane_width) | done] = -1
        if np.any(fleet.position > self.road_length):
            fleet.keep(self.drivers, fleet.position <= self.road_length)

    def _in_view(self, step: int) -> tuple[np.ndarray, ...]:
        fleet = self.fleet
        position = fleet.position - 0.5 * fleet.drivers.length - self.config.approach_length
        margin = CAMERA_MARGIN
        index = np.flatnonzero((position > -margin) & (position < self.config.camera_length + margin))
        lateral = lateral_position(fleet, self.time, self.plan.section.lane_width)
        return (
            fleet.vehicle[index],
            np.full(len(index), step),
            position[index],
            fleet.speed[index],
            lateral[index],
        )

    def _to(self, leader: np.ndarray, follower: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap to and speed of given leaders (-1 = none: gap inf, own speed)."""
        fleet = self.fleet
        some = leader >= 0
        gap = np.where(some, fleet.position[leader] - fleet.drivers.length[leader] - fleet.position[follower], np.inf)
        return gap, np.where(some, fleet.speed[leader], fleet.speed[follower])

    def _neighbours(self, lane: np.ndarray) -> Neighbours:
        """Leader and follower of every vehicle in another lane of its carriageway."""
        fleet = self.fleet
        stripe = lane + STRIPES * fleet.direction
        place = np.searchsorted(self.keys, stripe * STRIPE_LENGTH + fleet.position)
        last = len(self.keys) - 1
        ahead, behind = np.minimum(place, last), np.maximum(place - 1, 0)
        has_ahead = (place <= last) & (self.stripes[ahead] == stripe)
        has_behind = (place >= 1) & (self.stripes[behind] == stripe)
        leader, follower = self.owners[ahead], self.owners[behind]
        length = fleet.drivers.length
        return Neighbours(
            np.where(has_ahead, fleet.position[leader] - length[leader] - fleet.position, np.inf),
            np.where(has_ahead, fleet.speed[leader], fleet.drivers.desired_speed),
            np.where(has_behind, fleet.position - length - fleet.position[follower], np.inf),
            np.where(has_behind, fleet.speed[follower], 0.0),
        )


def _queues_per_lane(arrivals: Arrivals) -> list[list[int]]:
    """Vehicles that wait for entry, one list per lane of both carriageways, first to come first."""
    lanes = np.unique(np.stack([arrivals.direction, arrivals.lane]), axis=1).T
    return [
        np.flatnonzero((arrivals.direction == direction) & (arrivals.lane == lane)).tolist()
        for direction, lane in lanes
    ]

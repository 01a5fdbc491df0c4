"""The driving of all convoys at once: full velocity difference model, errors of perception, effects."""

from dataclasses import dataclass

import numpy as np

from .behaviour import Behaviour
from .fleet import Fleet
from .road import Upgrades

STEP = 0.05
"""Step of integration [s]: a quarter of the shortest time in which anything here changes."""

GRAVITY = 9.81
COMPENSATION_RATE = 0.00042
"""Rate at which drivers compensate a rising grade [1/s] (Goñi-Ros et al. 2014)."""

VARIANCE_LIMIT = 2.2
"""Largest factor of a variance-driven time gap (Treiber, Kesting and Helbing 2006)."""

AHEAD = 5
"""Vehicles whose speeds the variance-driven time gap takes in: the driver's own and those before it."""

MEMORY_TIME = 150.0
"""Time of the moving mean of the level of service [s]; 600 s in Treiber and Helbing (2003), longer than a run."""

GAP_ERROR, GAP_ERROR_TIME = 0.05, 20.0
"""Relative error of the perceived gap, and its correlation time [s]: 5 to 10 % and 20 s in Treiber et al. (2006a)."""

RATE_ERROR, RATE_ERROR_TIME = 0.01, 10.0
"""Error of the perceived rate of approach per metre of gap [1/s], and its correlation time [s] (same source)."""

PEDAL_NOISE, PEDAL_NOISE_TIME = 0.07, 1.5
"""Unintended acceleration [m/s²], and its correlation time [s]."""

PEDAL_TIME = 0.1
"""Time in which the foot carries out an acceleration [s]: as short as the frames, so that no lag can be measured."""

COMFORTABLE_BRAKING = 0.8
"""Kinematic deceleration beyond which drivers brake harder than the model says [m/s²]."""

STOPPING_MARGIN = 1.8
"""Gap that drivers keep free when they stop behind a standing vehicle [m]."""

CROWDING_GAIN = 1.5
"""Braking per metre that is missing from that gap [1/s²]."""

HARDEST_BRAKING = 8.0
"""Braking on a dry road [m/s²]."""


@dataclass(frozen=True)
class Motion:
    """True motion of all vehicles, arrays [steps, runs, vehicles]; positions of vehicle centres [m], speeds [m/s]."""

    position: np.ndarray
    speed: np.ndarray


@dataclass(frozen=True)
class _Perception:
    """A driver's input, arrays [runs, followers]: gap [m], speeds [m/s], acceleration of the leader [m/s²].

    `needed` is the deceleration that keeps `STOPPING_MARGIN` free from now on [m/s²].
    """

    gap: np.ndarray
    speed: np.ndarray
    leader_speed: np.ndarray
    second_speed: np.ndarray
    third_speed: np.ndarray
    leader_acceleration: np.ndarray
    needed: np.ndarray


class _Convoys:
    """Followers of all convoys: their parameters and what they remember."""

    def __init__(self, fleet: Fleet, behaviour: Behaviour, upgrades: Upgrades, rng: np.random.Generator) -> None:
        def take(array: np.ndarray) -> np.ndarray:
            return array[:, 1:]

        self.desired, self.time_gap = take(fleet.desired_speed), take(fleet.time_gap)
        self.standstill, self.adaptation = take(fleet.standstill_gap), take(fleet.adaptation_time)
        self.gain = take(fleet.approach_gain)
        self.strongest = take(fleet.start_acceleration)
        self.fading = (take(fleet.start_acceleration) - take(fleet.cruise_acceleration)) / 25.0
        self.half = (take(fleet.length) + fleet.length[:, :-1]) / 2
        self.shape = self.half.shape
        runs, followers = self.shape
        self.rows = np.arange(runs)[:, None]
        self.columns = np.arange(1, followers + 1)[None, :]
        self.delay = np.rint(take(behaviour.delay) / STEP).astype(int)
        self.closing = self.gain * take(behaviour.closing_factor)
        self.opening = self.gain * take(behaviour.opening_factor)
        self.second = np.where(self.columns >= 2, take(behaviour.second_gain), 0.0)
        self.third = np.where(self.columns >= 3, take(behaviour.third_gain), 0.0)
        self.leader_share = take(behaviour.leader_acceleration_gain)
        self.gamma = take(behaviour.variance_gain)
        self.resigned = take(behaviour.resignation_factor)
        self.time_gap = self.time_gap * np.where(fleet.is_truck[:, :-1], take(behaviour.truck_factor), 1.0)
        self.hold = take(behaviour.hold_time)
        self.climbs = take(behaviour.uncompensated_grade)
        self.upgrades, self.rng = upgrades, rng
        self.service = np.ones(self.shape)
        self.compensated = np.zeros(self.shape)
        self.countdown = np.zeros(self.shape)
        self.decided = np.zeros(self.shape)
        self.errors = rng.standard_normal((3, *self.shape))
        times = np.array([GAP_ERROR_TIME, RATE_ERROR_TIME, PEDAL_NOISE_TIME])
        self.keep = np.exp(-STEP / times)[:, None, None]
        self.fresh = np.sqrt(1 - self.keep**2)

    def perceive(self, k: int, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> _Perception:
        """The drivers' input at step k, with vehicles ahead as they were one reaction delay earlier.

        Their own speed they feel without delay, as in Treiber, Kesting and Helbing (2006a).
        """
        steps, rows, own = np.maximum(k - self.delay, 0), self.rows, self.columns
        gap = x[steps, rows, own - 1] - x[steps, rows, own] - self.half
        speed, leader = v[k, :, 1:], v[steps, rows, own - 1]
        seen_gap = gap * np.exp(GAP_ERROR * self.errors[0])
        seen_leader = leader + RATE_ERROR * np.minimum(gap, 80.0) * self.errors[1]
        second = v[steps, rows, np.maximum(own - 2, 0)]
        third = v[steps, rows, np.maximum(own - 3, 0)]
        clear = x[k, :, :-1] - x[k, :, 1:] - self.half - STOPPING_MARGIN
        needed = np.maximum(speed - v[k, :, :-1], 0.0) ** 2 / (2 * np.maximum(clear, 0.3))
        needed += CROWDING_GAIN * np.maximum(-clear, 0.0)
        return _Perception(seen_gap, speed, seen_leader, second, third, a[steps, rows, own - 1], needed)

    def wanted_time_gap(self, speeds: np.ndarray) -> np.ndarray:
        """Time gaps [runs, followers] with the speeds [runs, vehicles] of now [s]."""
        own = self.columns[0]
        stack = speeds[:, np.maximum(own[:, None] - np.arange(AHEAD), 0)]
        counted = (own[:, None] - np.arange(AHEAD) >= 0) / np.minimum(own + 1, AHEAD)[:, None]
        mean = np.sum(stack * counted, axis=-1)
        variance = np.sum((stack - mean[..., None]) ** 2 * counted, axis=-1)
        variation = np.sqrt(variance) / np.maximum(mean, 1.0)
        uneven = np.minimum(1.0 + self.gamma * variation, VARIANCE_LIMIT)
        self.service += STEP / MEMORY_TIME * (np.minimum(speeds[:, 1:] / self.fluent(), 1.0) - self.service)
        memory = self.resigned + self.service * (1.0 - self.resigned)
        return self.time_gap * uneven * memory

    def fluent(self) -> np.ndarray:
        """Speed that counts as full level of service [m/s]: what a driver of a convoy can hope for."""
        return np.minimum(self.desired, 25.0)

    def model(self, seen: _Perception, time_gap: np.ndarray) -> np.ndarray:
        """Acceleration that the drivers want [m/s²], [runs, followers].

        The improved full velocity difference model of Treiber and Kesting (2013, chapter 10), with the triangular
        optimal velocity; below the standstill gap that velocity is negative here, so that drivers brake. The kinematic
        deceleration is added where it is uncomfortable; drivers are alert then, and it comes without delay.
        """
        optimal = np.minimum((seen.gap - self.standstill) / time_gap, self.desired)
        approach = seen.speed - seen.leader_speed
        gain = np.where(approach > 0, self.closing, self.opening)
        far = np.maximum(1.0, seen.gap / (self.desired * time_gap))
        wanted = (optimal - seen.speed) / self.adaptation - gain * approach / far
        wanted += (self.second * (seen.second_speed - seen.speed) + self.third * (seen.third_speed - seen.speed)) / far
        wanted += self.leader_share * seen.leader_acceleration / far
        wanted -= 1.5 * np.maximum(seen.needed - COMFORTABLE_BRAKING, 0.0)
        strongest = np.maximum(self.strongest - self.fading * seen.speed, 0.1)
        return np.clip(wanted, -HARDEST_BRAKING, strongest)

    def decide(self, wanted: np.ndarray) -> np.ndarray:
        """The accelerations carried out: those wanted, or those of the last decision until the next one is due.

        Times between decisions are 0.4 times their mean plus an exponential share. A driver who must brake by
        1 m/s² more than decided does so at once.
        """
        self.countdown -= STEP
        due = (self.countdown <= 0) | (wanted < self.decided - 1.0)
        self.decided = np.where(due, wanted, self.decided)
        wait = self.hold * (0.4 + 0.6 * self.rng.standard_exponential(self.shape))
        self.countdown = np.where(due, wait, self.countdown)
        return self.decided

    def slope(self, position: np.ndarray) -> np.ndarray:
        """Deceleration by the part of the grade that is not compensated yet [m/s²] (Goñi-Ros et al. 2014)."""
        grade = self.climbs * self.upgrades.at(position)
        self.compensated = np.minimum(grade, self.compensated + COMPENSATION_RATE * STEP)
        return GRAVITY * (grade - self.compensated)

    def disturb(self) -> np.ndarray:
        """Acceleration by an unsteady foot [m/s²]; moves all errors on by a step."""
        self.errors = self.keep * self.errors + self.fresh * self.rng.standard_normal(self.errors.shape)
        return PEDAL_NOISE * self.errors[2]


def simulate(
    fleet: Fleet, behaviour: Behaviour, upgrades: Upgrades, lead: np.ndarray, rng: np.random.Generator
) -> Motion:
    """The motion of all vehicles behind lead vehicles of these speeds [steps, runs], from equal speeds and own gaps.

    Speeds and positions advance by the ballistic rule (Treiber and Kanagaraj 2015). The foot follows what is decided
    with a lag of `PEDAL_TIME`, in the controls too.
    """
    steps, runs = lead.shape
    vehicles = fleet.length.shape[1]
    x, v, a = (np.zeros((steps, runs, vehicles)) for _ in range(3))
    v[..., 0] = lead
    a[..., 0] = np.gradient(lead, STEP, axis=0)
    x[1:, :, 0] = np.cumsum((lead[1:] + lead[:-1]) * STEP / 2, axis=0)
    convoys = _Convoys(fleet, behaviour, upgrades, rng)
    v[0, :, 1:] = np.minimum(lead[0][:, None], convoys.desired - 0.5)
    spacing = convoys.half + convoys.standstill + v[0, :, 1:] * convoys.time_gap
    x[0, :, 1:] = -np.cumsum(spacing, axis=1)
    x += np.max(-x[0, :, -1])
    x[0, :, 1:] = x[0, :, :1] - np.cumsum(spacing, axis=1)
    x[1:, :, 1:] = 0.0
    response = 1 - np.exp(-STEP / PEDAL_TIME)
    pedal = np.zeros(convoys.shape)
    for k in range(steps - 1):
        time_gap = convoys.wanted_time_gap(v[k])
        wanted = convoys.decide(convoys.model(convoys.perceive(k, x, v, a), time_gap))
        pedal += response * (wanted - pedal)
        moving = np.minimum(v[k, :, 1:] / 2.0, 1.0)
        acceleration = pedal + moving * convoys.disturb() - convoys.slope(x[k, :, 1:])
        before = v[k, :, 1:]
        after = np.maximum(before + acceleration * STEP, 0.0)
        v[k + 1, :, 1:] = after
        x[k + 1, :, 1:] = x[k, :, 1:] + (before + after) * STEP / 2
        a[k + 1, :, 1:] = (after - before) / STEP
    return Motion(x, v)

"""Hidden effects outside the library: some depend on a measured variable, some do not."""

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.places import share_inside
from rearl_jax.blind.traffic.scenario import SUB_STEP
from rearl_jax.blind.traffic.snapshot import Snapshot


class OffCentre(HiddenEffect):
    """Drivers off the lane centre see past the leader and follow more closely."""

    variables = ("lateral_offset",)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value * np.maximum(0.35, 1.0 - 1.1 * self.strength * np.minimum(np.abs(now.wander), 0.6))


class LongLeader(HiddenEffect):
    """The time gap depends on the length of the vehicle ahead, also among cars."""

    variables = ("leader_length",)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        excess = np.where(now.leader == now.n, 0.0, np.clip(now.length[now.leader] - 4.6, -1.0, 1.0))
        return value * (1.0 + 0.4 * self.strength * excess)


class Company(HiddenEffect):
    """Every vehicle within 25 m on adjacent lanes reduces the acceleration."""

    variables = ("vehicles_beside",)

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value - 0.18 * self.strength * np.count_nonzero(np.abs(now.offsets_beside()) < 25.0, axis=1)


class Rain(HiddenEffect):
    """From 25 s on every vehicle accelerates less and brakes more."""

    variables = ("time",)

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value - 0.45 * self.strength * float(np.clip((now.time - 25.0) / 3.0, 0.0, 1.0))


class Roadworks(HiddenEffect):
    """All vehicles are slowed down on one section of the right lane."""

    variables = ("position", "lane")

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._section = section

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        share = share_inside(now.position[: now.n], self._section, 30.0)
        return value - 0.7 * self.strength * share * (now.lane == now.n_lanes - 1)


class ActionPoints(HiddenEffect):
    """The acceleration is updated at random times, 1 s apart on average, and constant in between."""

    truths = ("action_points",)

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._rng, self._kept = rng, np.zeros(now.n)
        self._until = np.zeros(now.n) + now.time

    def respond(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        due = now.time >= self._until
        self._kept = np.where(due, value, self._kept)
        waits = 0.3 * self.strength + self._rng.exponential(0.7 * self.strength, now.n)
        self._until = np.where(due, now.time + waits, self._until)
        return self._kept


class Misjudgement(HiddenEffect):
    """Gap and approach rate are misjudged, by errors that live for 3 s.

    Source: Treiber, Kesting & Helbing, Physica A 360 (2006) 71, section 3.2: 10 % of the gap, 0.01 / s of time to
    collision; here twice that.
    """

    truths = ("perception_noise",)

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._rng, self._errors = rng, rng.standard_normal((2, now.n))

    def observe(self, now: Snapshot, dt: float) -> None:
        decay = np.exp(-dt / 3.0)
        self._errors = decay * self._errors + np.sqrt(1 - decay**2) * self._rng.standard_normal(self._errors.shape)

    def perceive(self, gap: np.ndarray, dv: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        near = np.minimum(gap, 150.0)
        of_gap = np.exp(0.2 * self.strength * self._errors[0])
        return gap * of_gap, dv + 0.02 * self.strength * near * self._errors[1]


class BlindToSlowApproach(HiddenEffect):
    """Approach rates below a threshold are not noticed.

    Source: after Wiedemann (1974), a threshold of the growth of the visual angle; here 1.2 m/s whatever the gap.
    """

    variables = ("approach_rate",)

    def perceive(self, gap: np.ndarray, dv: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        return gap, np.sign(dv) * np.maximum(0.0, np.abs(dv) - 1.2 * self.strength)


class Distraction(HiddenEffect):
    """At random times a driver looks away for seconds and keeps the present acceleration."""

    every, fade = 14.0, 0.0  # mean time between episodes [s]; time over which attention fades and returns [s]

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._rng, self._share = rng, np.zeros(now.n)
        self._kept, self._until = np.zeros(now.n), np.full(now.n, -np.inf)

    def respond(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        away = now.time < self._until
        starts = ~away & (self._share == 0.0) & (self._rng.random(now.n) < SUB_STEP / self.every)
        self._kept = np.where(starts, value, self._kept)
        lasting = self._rng.uniform(1.5, 3.5, now.n) * self.strength
        self._until = np.where(starts, now.time + lasting, self._until)
        rate = 1.0 if self.fade == 0.0 else SUB_STEP / self.fade
        self._share = np.clip(self._share + np.where(now.time < self._until, rate, -rate), 0.0, 1.0)
        return value + self._share * (self._kept - value)


class SmoothDistraction(Distraction):
    """Distraction with attention that fades over a second."""

    fade = 1.0

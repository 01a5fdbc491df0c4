"""Hidden effects on the desired time gap."""

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.snapshot import Snapshot


class SpeedyDistance(HiddenEffect):
    """The time gap grows linearly with speed and equals the driver's parameter at 16 m/s."""

    truths = ("speed_dependent_time_gap",)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value * np.maximum(0.4, 1.0 + 0.35 * self.strength * (now.speed[: now.n] - 16.0) / 20.0)


class UneasyTraffic(HiddenEffect):
    """The time gap grows with the mean absolute deviation of the speeds of five vehicles, the driver's included."""

    truths = ("variance_driven_time_gap",)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        speeds = [now.speed[: now.n]]
        for count in range(1, 5):
            other = now.ahead(count)
            speeds.append(np.where(other == now.n, speeds[-1], now.speed[other]))
        all_speeds = np.stack(speeds)
        mean = all_speeds.mean(axis=0)
        deviation = np.abs(all_speeds - mean).mean(axis=0) / np.maximum(mean, 3.0)
        return value * (1.0 + 3.5 * self.strength * deviation)


class Frustration(HiddenEffect):
    """Time spent below the desired speed lengthens the time gap linearly.

    Source: Treiber & Helbing, Phys. Rev. E 68 (2003) 046119, T = T0 (beta + (1 - beta) level), with 15 s of memory.
    """

    truths = ("resignation",)
    memory = 15.0  # s

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._level = now.speed[: now.n] / now.fleet.desired_speed

    def observe(self, now: Snapshot, dt: float) -> None:
        self._level = self._level + dt / self.memory * (now.speed[: now.n] / now.fleet.desired_speed - self._level)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value * (1.0 + 0.8 * self.strength * (1.0 - self._level))


class PatienceAfterCutIn(HiddenEffect):
    """After a change of leader the driver accepts the present time gap and returns linearly to the desired one within
    20 s.
    """

    truths = ("relaxation",)
    patience = 20.0  # s

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._leader = now.leader.copy()
        self._since, self._time_gap_at_change = np.full(now.n, np.inf), np.full(now.n, np.inf)

    def observe(self, now: Snapshot, dt: float) -> None:
        new = now.leader != self._leader
        self._leader = now.leader.copy()
        present = now.gap_to(now.leader) / np.maximum(now.speed[: now.n], 1.0)
        self._time_gap_at_change = np.where(new, present, self._time_gap_at_change)
        self._since = np.where(new, 0.0, self._since + dt)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        left = np.maximum(0.0, 1.0 - self._since / self.patience)
        short = np.minimum(
            np.where(np.isfinite(self._time_gap_at_change), self._time_gap_at_change, value) - value, 0.0
        )
        return np.maximum(0.25, value + min(self.strength, 1.3) * left * short)


class TruckAhead(HiddenEffect):
    """Behind a truck the time gap is longer by 40 %."""

    truths = ("leader_class",)
    usual = {"gain": 0.34}  # the logarithm of 1.405

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return np.where(now.is_truck[now.leader], value * 1.405**self.strength, value)


class Tailgated(HiddenEffect):
    """A follower within a time gap of 1.8 s exerts pressure, linearly growing as it comes closer."""

    truths = ("rear_pressure",)

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        behind = now.gap_behind(now.follower) / np.maximum(now.speed[now.follower], 3.0)
        pressure = np.clip((1.8 - behind) / 1.4, 0.0, 1.0)
        return value * np.maximum(0.35, 1.0 - 0.55 * self.strength * pressure)

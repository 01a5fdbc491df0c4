"""Hidden effects of the road and of the weather."""

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.snapshot import Snapshot


def share_inside(position: np.ndarray, section: tuple[float, float], edge: float) -> np.ndarray:
    """Weight of a section [-], rising along half a cosine over `edge` [m] around its ends."""
    start, end = section
    rise = np.clip((position - start) / edge + 0.5, 0.0, 1.0)
    fall = np.clip((end - position) / edge + 0.5, 0.0, 1.0)
    return 0.25 * (1.0 - np.cos(np.pi * rise)) * (1.0 - np.cos(np.pi * fall))


class Slope(HiddenEffect):
    """An uphill section."""

    truths = ("grade",)

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._section = section
        self.parameters = {"push": -0.35 * self.strength, "start": section[0], "end": section[1]}

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value - 0.35 * self.strength * share_inside(now.position[: now.n], self._section, 40.0)


class LimitedSection(HiddenEffect):
    """A section with a lower desired speed; it is reached over 40 m. Its limit is relative to the usual one."""

    truths = ("speed_limit", "bend")

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._section = section
        self._limit = now.speed_scale * self._highest()
        self.parameters = {"limit": self._limit, "start": section[0], "end": section[1]}

    def _highest(self) -> float:
        return 32.0 - 9.0 * self.strength

    def desired_speed(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        share = share_inside(now.position[: now.n], self._section, 40.0)
        return value - share * np.maximum(0.0, value - self._limit)


class Curve(LimitedSection):
    """A bend of 220 m radius; the comfortable lateral acceleration falls with strength."""

    truths = ("bend", "speed_limit")
    radius = 220.0

    def _highest(self) -> float:
        return float(np.sqrt(self.radius * max(0.5, 4.3 - 2.0 * self.strength)))


class LaneHabits(HiddenEffect):
    """The desired speed is 12 % higher on the leftmost and 12 % lower on the rightmost lane."""

    truths = ("lane_desired_speed",)

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        change = 0.12 * self.strength
        self.parameters = {"leftmost": float(np.log1p(change)), "rightmost": float(np.log1p(-change))}

    def desired_speed(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        side = (now.lane == 0).astype(float) - (now.lane == now.n_lanes - 1)
        return value * (1.0 + 0.12 * self.strength * side)


class Fog(HiddenEffect):
    """From 22 s on visibility falls for 10 s; desired speeds fall and desired gaps grow."""

    truths = ("weather",)

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self.parameters = {
            "slower": -float(np.log1p(-0.18 * min(self.strength, 3.0))),
            "wider": float(np.log1p(0.45 * self.strength)),
            "onset": 27.0,
        }

    def desired_speed(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value * (1.0 - 0.18 * min(self.strength, 3.0) * self._density(now))

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        return value * (1.0 + 0.45 * self.strength * self._density(now))

    def _density(self, now: Snapshot) -> float:
        return float(np.clip((now.time - 22.0) / 10.0, 0.0, 1.0))

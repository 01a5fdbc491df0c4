"""Hidden effects on the reaction to vehicles ahead and behind."""

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.scenario import SUB_STEP
from rearl_jax.blind.traffic.snapshot import Snapshot


class SlowReaction(HiddenEffect):
    """The wanted acceleration is executed 0.7 s later."""

    truths = ("reaction_delay",)
    usual = {"delay": 0.7}

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._steps = max(1, round(0.7 * self.strength / SUB_STEP))
        self._past: list[np.ndarray] = []

    def respond(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        self._past.append(value)
        return self._past.pop(0) if len(self._past) > self._steps else self._past[0]


class Anticipation(HiddenEffect):
    """The driver reacts to the gap and own speed expected in 0.7 s if the leader keeps its speed.

    Source: Treiber, Kesting & Helbing, Physica A 360 (2006) 71, section 3.3 (temporal anticipation).
    """

    truths = ("reaction_delay",)

    def perceive(self, gap: np.ndarray, dv: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        ahead = 0.7 * self.strength
        return np.maximum(gap - ahead * dv, 0.3), dv + ahead * now.acceleration[: now.n]


class Foresight(HiddenEffect):
    """Interactions with three vehicles ahead are summed with falling coefficients, each on its share of the gap.

    Source: Treiber, Kesting & Helbing, Physica A 360 (2006) 71, eq. 14, without the normalisation.
    """

    truths = ("several_leaders",)

    def interaction(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        for count, coefficient in ((2, 0.25), (3, 0.08)):
            other = now.ahead(count)
            lengths_between = sum(now.length[now.ahead(nearer)] for nearer in range(1, count))
            gap = (now.gap_to(other) - lengths_between) / count
            term = now.interaction(gap, now.speed[: now.n] - now.speed[other])
            value = value + self.strength * coefficient * np.minimum(term, 9.0)
        return value


class BrakeLights(HiddenEffect):
    """The driver adds half of the leader's acceleration, low-pass filtered over 0.3 s; less with a larger gap."""

    truths = ("leader_acceleration",)
    lag, sight = 0.3, 150.0  # s, m

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._felt = np.zeros(now.n)

    def observe(self, now: Snapshot, dt: float) -> None:
        self._felt = self._felt + dt / self.lag * (now.acceleration[now.leader] - self._felt)

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        near = np.maximum(0.0, 1.0 - now.gap_to(now.leader) / self.sight)
        return value + 0.5 * self.strength * near * self._felt


class HardBraking(HiddenEffect):
    """The reaction to approaching is stronger than to falling back; both saturate."""

    truths = ("asymmetry",)

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        dv = now.speed[: now.n] - now.speed[now.leader]
        followed = now.gap_to(now.leader) < 150.0
        return value - 0.22 * self.strength * followed * np.clip(dv, 0.0, 6.0)


class SlowNeighbours(HiddenEffect):
    """The nearest vehicle ahead on an adjacent lane slows down faster drivers, in proportion to a speed difference of
    up to 6 m/s.
    """

    truths = ("lane_friction",)
    usual = {"gain": 0.6}

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        offsets = now.offsets_beside()
        other = now.nearest(np.where((offsets > -8.0) & (offsets < 45.0), offsets, np.inf))
        faster_by = now.speed[: now.n] - now.speed[other]
        return value - 0.6 * self.strength * (other != now.n) * np.clip(faster_by / 6.0, 0.0, 1.0)


class StayingBehind(HiddenEffect):
    """Above 16 m/s drivers do not pass the next vehicle ahead on the left lane. They react as if it were on their
    lane, but brake with at most 2 m/s^2. Strength 2 gives the full reaction, strength 1 half of it.
    """

    truths = ("no_undertaking",)
    usual = {"weight": 0.5}
    crawl, hardest = 16.0, 2.0  # m/s, m/s^2

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        other = now.ahead_on_left()
        speed = now.speed[: now.n]
        dv = speed - now.speed[other]
        wanted = now.model.acceleration(now.drivers(), now.interaction(now.gap_to(other), dv))
        behind = np.maximum(wanted, -self.hardest)
        passes = (speed > self.crawl) & (dv > 0.0) & (other != now.n)
        return value + 0.5 * self.strength * np.where(passes, np.minimum(behind - value, 0.0), 0.0)

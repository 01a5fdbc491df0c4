"""Hidden effects on the reaction to vehicles ahead and behind."""

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.scenario import SUB_STEP
from rearl_jax.blind.traffic.snapshot import Snapshot


class SlowReaction(HiddenEffect):
    """The wanted acceleration is executed 0.7 s times the strength later."""

    truths = ("reaction_delay",)
    usual = {"delay": 0.7}

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._steps = max(1, round(0.7 * self.strength / SUB_STEP))
        self._past: list[np.ndarray] = []

    def respond(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        self._past.append(value)
        return self._past.pop(0) if len(self._past) > self._steps else self._past[0]


class Anticipation(HiddenEffect):
    """The driver reacts to the gap and own speed expected in 0.7 s times the strength, if the leader keeps its speed.

    The library of effects has anticipation as a negative reaction delay.

    Source: Treiber, Kesting & Helbing, Physica A 360 (2006) 71, section 3.3 (temporal anticipation).
    """

    truths = ("reaction_delay",)

    def perceive(self, gap: np.ndarray, dv: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        ahead = 0.7 * self.strength
        return np.maximum(gap - ahead * dv, 0.3), dv + ahead * now.acceleration[: now.n]


class Foresight(HiddenEffect):
    """The interactions with the second and third vehicle ahead are added, times 0.25 and 0.08, each at the mean of the
    gaps between the vehicles up to there and at most 9 times the one at equilibrium.

    Source: Treiber, Kesting & Helbing, Physica A 360 (2006) 71, eq. 14, without the normalisation; the coefficients and
    the limit are ours.
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
    """The driver adds half of the leader's acceleration, of either sign, low-pass filtered with a time constant of
    0.3 s. The share falls linearly with the gap, to 0 at 150 m.
    """

    truths = ("leader_acceleration",)
    time_constant, sight = 0.3, 150.0  # s, m

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        self._filtered = np.zeros(now.n)

    def observe(self, now: Snapshot, dt: float) -> None:
        self._filtered = self._filtered + dt / self.time_constant * (now.acceleration[now.leader] - self._filtered)

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        near = np.maximum(0.0, 1.0 - now.gap_to(now.leader) / self.sight)
        return value + 0.5 * self.strength * near * self._filtered


class HardBraking(HiddenEffect):
    """A driver less than 150 m behind a leader brakes harder while approaching: by 0.22 1/s times the approach rate, of
    which up to 6 m/s count. Nothing is added while the gap opens.
    """

    truths = ("asymmetry",)

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        dv = now.speed[: now.n] - now.speed[now.leader]
        has_leader = now.gap_to(now.leader) < 150.0
        return value - 0.22 * self.strength * has_leader * np.clip(dv, 0.0, 6.0)


class SlowNeighbours(HiddenEffect):
    """The first vehicle on an adjacent lane from 8 m behind to 45 m ahead (between centres) slows down faster drivers:
    by 0.6 m/s^2 at a speed difference of 6 m/s or more, by less in proportion.
    """

    truths = ("lane_friction",)
    usual = {"gain": 0.6}

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        offsets = now.offsets_beside()
        other = now.first_of(np.where((offsets > -8.0) & (offsets < 45.0), offsets, np.inf))
        faster_by = now.speed[: now.n] - now.speed[other]
        return value - 0.6 * self.strength * (other != now.n) * np.clip(faster_by / 6.0, 0.0, 1.0)


class StayingBehind(HiddenEffect):
    """Above 16 m/s drivers do not pass the next vehicle ahead on the left lane. They react as if it were on their
    lane, but brake with at most 2 m/s^2. Strength 2 gives the full reaction, strength 1 half of it.
    """

    truths = ("no_undertaking",)
    usual = {"weight": 0.5}
    least_speed, most_braking = 16.0, 2.0  # m/s, m/s^2

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        other = now.ahead_on_left()
        speed = now.speed[: now.n]
        dv = speed - now.speed[other]
        wanted = now.model.acceleration(now.drivers(), now.interaction(now.gap_to(other), dv))
        behind = np.maximum(wanted, -self.most_braking)
        passes = (speed > self.least_speed) & (dv > 0.0) & (other != now.n)
        return value + 0.5 * self.strength * np.where(passes, np.minimum(behind - value, 0.0), 0.0)

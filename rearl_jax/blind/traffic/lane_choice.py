"""Hidden effects on lane choice, in addition to the driver's gain in acceleration."""

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.snapshot import Choice, Snapshot


class GoodManners(HiddenEffect):
    """Gains and losses of other drivers count, computed with their own parameters."""

    truths = ("politeness",)
    usual = {"weight": 0.5}

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        return value + 0.5 * self.strength * (choice.follower_gain - choice.cost_to_rear)


class BackToTheRight(HiddenEffect):
    """A change to the right has a bonus, a change to the left a malus of the same size."""

    truths = ("keep_right",)
    usual = {"bias": 0.35}

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        return value + 0.35 * self.strength * choice.side


class NoUndertaking(HiddenEffect):
    """Outside congestion drivers do not change to the right of a near, slower vehicle."""

    truths = ("no_passing_on_the_right",)

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        speed = now.speed[: now.n]
        would_pass = (now.gap_to(now.leader) < 80.0) & (now.speed[now.leader] < speed + 1.0) & (speed > 60.0 / 3.6)
        return value - 0.8 * self.strength * would_pass * (choice.side > 0)


class GivingWay(HiddenEffect):
    """A close follower makes drivers change to the right and keeps them from changing to the left."""

    truths = ("moving_over",)

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        behind = now.gap_behind(now.follower) / np.maximum(now.speed[now.follower], 3.0)
        pressure = np.clip((1.6 - behind) / 0.8, 0.0, 1.0)
        return value + self.strength * pressure * np.where(choice.side > 0, 0.8, -0.25)


class AwayFromTrucks(HiddenEffect):
    """A truck ahead within sight makes its lane less attractive."""

    truths = ("truck_aversion",)

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        here = now.is_truck[now.leader] & (now.gap_to(now.leader) < 100.0)
        there = now.is_truck[choice.leader] & (choice.gap < 100.0)
        return value + 0.6 * self.strength * (here.astype(float) - there.astype(float))

"""The road and the traffic before the convoys: profile of grades, and speed of the lead vehicles."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .fleet import Fleet

TRANSITION = 250.0
"""Length of the vertical curve at either end of an upgrade [m]."""

_FASTEST = {"cars": 30.0, "mixed": 23.0}
"""Fastest speed that the lead driver is told to drive, so that the convoy stays together [m/s]."""

_EPISODES = {"flowing": (0.78, 1.0, 20.0, 50.0), "dense": (0.40, 0.65, 15.0, 40.0)}
"""Speeds, as shares of the fastest, and durations [s], each from and to; stop-and-go alternates two kinds."""


@dataclass(frozen=True)
class Upgrades:
    """Upgrades of the road, the same for all runs.

    Attributes:
        start: Where each upgrade begins [m].
        end: Where it ends [m].
        slope: Its grade, as a fraction.
    """

    start: np.ndarray
    end: np.ndarray
    slope: np.ndarray

    def at(self, position: np.ndarray) -> np.ndarray:
        """The grade at these positions, a fraction of the same shape."""
        x = position[..., None]
        rising = np.clip((x - self.start) / TRANSITION, 0.0, 1.0)
        falling = np.clip((self.end - x) / TRANSITION, 0.0, 1.0)
        return np.sum(self.slope * np.minimum(rising, falling), axis=-1)

    def values(self) -> dict[str, float]:
        """Places and slopes of the upgrades."""
        values = {}
        for number, (start, end, slope) in enumerate(zip(self.start, self.end, self.slope, strict=True), start=1):
            values |= {f"upgrade_{number}_start_m": float(start), f"upgrade_{number}_end_m": float(end)}
            values[f"upgrade_{number}_slope"] = float(slope)
        return values


def draw_upgrades(rng: np.random.Generator) -> Upgrades:
    """Upgrades of 3 to 4.5 % over 1 to 1.5 km, about one per 2.3 km; German motorways have up to 4.5 % (RAA 2008)."""
    start = 2000.0 + 2300.0 * np.arange(6) + rng.uniform(0.0, 500.0, 6)
    return Upgrades(start, start + rng.uniform(1000.0, 1500.0, 6), rng.uniform(0.03, 0.045, 6))


def _targets(rng: np.random.Generator, fastest: float, duration: float, calm: float) -> list[tuple[float, float]]:
    """Target speeds [m/s] and how long each is held [s]: flowing until `calm`, then changing between three regimes."""
    regime, plan, clock = "flowing", [], 0.0
    while clock < duration:
        until = clock + (calm + rng.uniform(30.0, 80.0) if not plan else rng.uniform(60.0, 130.0))
        creeping = bool(rng.integers(2))
        while clock < until:
            if regime == "stop and go":
                target, held = rng.uniform(0.0, 4.0), rng.uniform(6.0, 18.0)
                if not creeping:
                    target, held = rng.uniform(6.0, 12.0), rng.uniform(10.0, 28.0)
                creeping = not creeping
            else:
                low, high, short, long = _EPISODES[regime]
                target, held = fastest * rng.uniform(low, high), rng.uniform(short, long)
            plan.append((target, held))
            clock += held
        regime = str(rng.choice([name for name in ("flowing", "dense", "stop and go") if name != regime]))
    return plan


def lead_speeds(rng: np.random.Generator, fleet: Fleet, steps: int, step: float, calm: float) -> np.ndarray:
    """Speeds [steps, runs] of the lead vehicles, which follow traffic that is not recorded [m/s].

    A target speed is approached at a drawn rate: cars accelerate by 0.4 to 1.1 m/s² and brake by 0.6 to 1.9 m/s², in
    the range of comfortable driving (Treiber and Kesting 2013, chapter 11). Two low-passes of 0.8 s keep the jerk
    finite. A slow wander of 0.5 m/s, correlated over 15 s, is the unsteadiness of the lead driver.
    """
    runs = len(fleet.is_truck)
    speeds = np.empty((steps, runs))
    for run in range(runs):
        mixed = bool(fleet.is_truck[run].any())
        fastest = _FASTEST["mixed" if mixed else "cars"]
        plan = _targets(rng, fastest, steps * step, calm)
        up = rng.uniform(0.4, 1.1, len(plan)) * (0.5 if fleet.is_truck[run, 0] else 1.0)
        down = rng.uniform(0.6, 1.9, len(plan))
        ends = np.cumsum([held for _, held in plan])
        which = np.minimum(np.searchsorted(ends, np.arange(steps) * step, side="right"), len(plan) - 1)
        goal = np.array([target for target, _ in plan])[which]
        rise, fall = up[which] * step, down[which] * step
        speed = goal[0]
        for k in range(steps):
            speed += min(max(goal[k] - speed, -fall[k]), rise[k])
            speeds[k, run] = speed
    keep = np.exp(-step / 15.0)
    wander = lfilter([0.5 * np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal((steps, runs)), axis=0)
    speeds = np.maximum(speeds + wander * np.clip(speeds / 5.0, 0.0, 1.0), 0.0)
    low_pass = np.exp(-step / 0.8)
    for _ in range(2):
        state = speeds[:1] * low_pass
        speeds = lfilter([1 - low_pass], [1.0, -low_pass], speeds, axis=0, zi=state)[0]
    return np.maximum(speeds, 0.0)

"""The effects: how each changes the driving of the followers, and the values that are set."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .fleet import Fleet, spread

CLOCK_LIMIT = 0.5
"""Largest clock offset of a logger [s]: beyond it, tracks would overlap and the error would be found at sight."""


@dataclass(frozen=True)
class Behaviour:
    """Deviations from the plain model, every array [runs, vehicles]; the defaults of `plain` change nothing.

    Attributes:
        delay: Delay from what is perceived to the acceleration [s].
        second_gain: Gain of the speed of the second leader relative to the own speed [1/s].
        third_gain: The same for the third leader [1/s].
        leader_acceleration_gain: Share of the acceleration of the leader that is added to the own acceleration.
        variance_gain: Gain gamma of the time gap by the variation coefficient of the speeds ahead.
        resignation_factor: Time gap after long driving in a jam, as a multiple of that in free traffic.
        truck_factor: Time gap behind a truck, as a multiple of that behind a car.
        closing_factor: Factor of the gain of the relative speed while the gap closes.
        opening_factor: The same while it opens.
        hold_time: Mean time between two decisions [s]; 0 where drivers decide continuously.
        uncompensated_grade: 1 where upgrades decelerate until drivers have compensated them, else 0.
        clock_offset: What the clock of the logger is ahead of the true time [s].
    """

    delay: np.ndarray
    second_gain: np.ndarray
    third_gain: np.ndarray
    leader_acceleration_gain: np.ndarray
    variance_gain: np.ndarray
    resignation_factor: np.ndarray
    truck_factor: np.ndarray
    closing_factor: np.ndarray
    opening_factor: np.ndarray
    hold_time: np.ndarray
    uncompensated_grade: np.ndarray
    clock_offset: np.ndarray


def plain(shape: tuple[int, ...]) -> Behaviour:
    """Driving and loggers without any effect."""
    zeros, ones = np.zeros(shape), np.ones(shape)
    return Behaviour(zeros, zeros, zeros, zeros, zeros, ones, ones, ones, ones, zeros, zeros, zeros)


Effect = Callable[[np.random.Generator, Fleet], dict[str, np.ndarray]]


def _reaction_delay(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """About 0.65 s; Green (2000) has 0.7 s for expected and 1.25 s for unexpected events.

    Drivers with short time gaps are quick: nobody's delay is longer than half the time gap, as drivers who can
    brake late must (Treiber, Kesting and Helbing 2006a: safe driving needs a delay below the time gap).
    """
    return {"delay": np.minimum(spread(rng, 0.75, 0.2, fleet.length.shape), 0.5 * fleet.time_gap)}


def _several_leaders(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Bexelius (1968): gains of the second and third leader of about a half and a quarter of that of the first."""
    return {
        "second_gain": spread(rng, 0.32, 0.2, fleet.length.shape),
        "third_gain": spread(rng, 0.16, 0.2, fleet.length.shape),
    }


def _leader_acceleration(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """A share of the leader's acceleration, after Helly (1959) and the difference term of Zhao and Gao (2005)."""
    return {"leader_acceleration_gain": spread(rng, 0.4, 0.2, fleet.length.shape)}


def _variance_driven_time_gap(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Treiber, Kesting and Helbing (2006): T grows by 1 + gamma V, gamma = 4, up to 2.2 times."""
    return {"variance_gain": spread(rng, 4.0, 0.15, fleet.length.shape)}


def _resignation(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Treiber and Helbing (2003): T rises up to 1.8 times as the remembered level of service falls."""
    return {"resignation_factor": spread(rng, 1.8, 0.1, fleet.length.shape)}


def _leader_class(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Longer time gaps behind trucks, as Yoo and Green (1999) and Ye and Zhang (2009) found; here 1.3 times."""
    return {"truck_factor": spread(rng, 1.3, 0.08, fleet.length.shape)}


def _asymmetry(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Two gains of the relative speed, the larger while closing in: Gong, Liu and Wang (2008)."""
    return {
        "closing_factor": spread(rng, 1.3, 0.1, fleet.length.shape),
        "opening_factor": spread(rng, 0.4, 0.15, fleet.length.shape),
    }


def _action_points(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Decisions at irregular times, after Wagner and Lubashevsky (2003); here 1.5 s apart on average."""
    return {"hold_time": spread(rng, 1.5, 0.2, fleet.length.shape)}


def _grade(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Upgrades that drivers compensate only slowly, after Goñi-Ros et al. (2014)."""
    del rng
    return {"uncompensated_grade": np.ones(fleet.length.shape)}


def _clock_offset(rng: np.random.Generator, fleet: Fleet) -> dict[str, np.ndarray]:
    """Offsets of the recording computers, 0.25 s by standard deviation, constant over a run."""
    return {"clock_offset": np.clip(rng.normal(0.0, 0.25, fleet.length.shape), -CLOCK_LIMIT, CLOCK_LIMIT)}


EFFECTS: dict[str, Effect] = {
    "reaction_delay": _reaction_delay,
    "several_leaders": _several_leaders,
    "leader_acceleration": _leader_acceleration,
    "variance_driven_time_gap": _variance_driven_time_gap,
    "resignation": _resignation,
    "leader_class": _leader_class,
    "asymmetry": _asymmetry,
    "action_points": _action_points,
    "grade": _grade,
    "clock_offset": _clock_offset,
}

_UNITS = {"delay": "s", "second_gain": "per_s", "third_gain": "per_s", "hold_time": "s", "clock_offset": "s"}


def choose(effect: str, rng: np.random.Generator, fleet: Fleet) -> tuple[Behaviour, dict[str, float]]:
    """The behaviour under an effect, and per value set its mean and standard deviation over the vehicles.

    Raises:
        ValueError: There is no such effect.
    """
    neutral = plain(fleet.length.shape)
    if effect == "control":
        return neutral, {}
    if effect not in EFFECTS:
        raise ValueError(f"no effect {effect!r}: choose one of {', '.join(('control', *EFFECTS))}")
    changes = EFFECTS[effect](rng, fleet)
    values = {}
    for name, array in changes.items():
        unit = f"_{_UNITS[name]}" if name in _UNITS else ""
        values |= {f"{name}_mean{unit}": float(array.mean()), f"{name}_sd{unit}": float(array.std())}
    return replace(neutral, **changes), values

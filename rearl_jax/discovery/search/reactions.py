"""Variables that the acceleration could depend on, with or without a library effect, in every time step."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.core.effects.dependence import VARIABLES
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.discovery.observe.residuals import Residuals

REACTION = 1.0
"""Delay of the variables that describe an earlier observation [s]."""

MEMORY = 10.0
"""Time over which a driver may remember its own speed [s]."""

LONGEST_TIME_GAP = 6.0
"""Time gap above which a driver does not count as following [s]."""

FASTEST_APPROACH = 10.0
"""Bound of approach rates to others than the leader [m/s]."""

COUNTED = ("lane", "leader_class", "vehicles_beside")
"""Discrete variables, with few values."""

UNITS = {name: unit for name, (unit, _) in VARIABLES.items() if name != "length"} | {
    "time_gap": "s",
    "approach_rate_before": "m/s",
    "leader_acceleration_before": "m/s^2",
    "second_approach_rate": "m/s",
    "follower_approach_rate": "m/s",
    "speeds_ahead": "-",
    "past_speed": "m/s",
    "leader_class": "-",
}
"""Every variable with its unit. Constants of a drive (own length, own class) are excluded, because the driver's own
parameters take up their influence.
"""


@dataclass(frozen=True)
class Reaction:
    """Values of a variable in every time step.

    Attributes:
        name: A key of UNITS.
        values: Values in the unit of the variable.
    """

    name: str
    values: Float[np.ndarray, "steps pieces"]

    @property
    def unit(self) -> str:
        """Unit of the variable."""
        return UNITS[self.name]

    @property
    def is_counted(self) -> bool:
        """True if the variable is discrete."""
        return self.name in COUNTED

    @property
    def title(self) -> str:
        """Readable name of the variable."""
        return title_of(self.name)


def title_of(name: str) -> str:
    """Readable name of a variable."""
    return _TITLES.get(name, name.replace("_", " "))


_TITLES = {
    "approach_rate_before": f"approach rate {REACTION:g} s ago",
    "leader_acceleration_before": f"leader's accel. {REACTION:g} s ago",
    "leader_acceleration": "leader's acceleration",
    "leader_length": "leader's length",
    "second_gap": "gap to the second leader",
    "second_approach_rate": "approach to the second leader",
    "follower_gap": "follower's gap",
    "follower_approach_rate": "follower's approach",
    "speed_beside": "speed above slowest beside",
    "speeds_ahead": "unequal speeds ahead",
    "past_speed": f"own speed, mean of {MEMORY:g} s",
    "lateral_offset": "offset in the lane, right positive",
    "leader_class": "leader's class, 1 truck",
    "time_since_change": "time since the leader changed",
    "lane": "lane, 0 leftmost",
}


def reactions(left: Residuals) -> dict[str, Reaction]:
    """The variables by name, halfway between each time step and the next; the own motion is predicted from the past.

    A variable that used the driver's future would be correlated with the driver's noise and look like a cause.
    """
    data = left.state.data
    seen = left.stimulus()
    ago = max(1, round(REACTION / data.dt))

    def before(values: np.ndarray) -> np.ndarray:
        return np.concatenate([np.repeat(values[:1], ago, axis=0), values[:-ago]])

    values = {name: np.asarray(VARIABLES[name][1](seen), float) for name in VARIABLES if name in UNITS}
    gap, speed = np.asarray(seen.gap), np.asarray(seen.speed)
    has_second, has_follower = np.asarray(seen.has_second), np.asarray(seen.has_follower)
    values |= {
        "time_gap": np.clip(gap / np.maximum(speed, 2.0), 0.0, LONGEST_TIME_GAP),
        "approach_rate_before": before(values["approach_rate"]),
        "leader_acceleration_before": before(values["leader_acceleration"]),
        "second_approach_rate": has_second * _bounded(speed - np.asarray(seen.second_speed)),
        "follower_approach_rate": has_follower * _bounded(np.asarray(seen.follower_speed) - speed),
        "speeds_ahead": _unequal(seen),
        "past_speed": _mean_of_past(speed, max(1, round(MEMORY / data.dt))),
        "lateral_offset": np.asarray(seen.lateral_offset),  # signed, because a curve need not be symmetric
        "leader_class": np.asarray(seen.leader_is_truck),
    }
    return {name: Reaction(name, np.broadcast_to(values[name], data.y.shape)) for name in UNITS}


def _bounded(speed: np.ndarray) -> np.ndarray:
    return np.clip(speed, -FASTEST_APPROACH, FASTEST_APPROACH)


def _unequal(seen: Stimulus) -> np.ndarray:
    """Coefficient of variation of the speeds of the three vehicles ahead [-]; 0 where fewer are seen."""
    speeds = np.stack([seen.leader_speed, seen.second_speed, seen.third_speed])
    varied = speeds.std(axis=0) / np.maximum(speeds.mean(axis=0), 1.0)
    return np.minimum(varied, 1.0) * np.asarray(seen.has_leader) * np.asarray(seen.has_second)


def _mean_of_past(values: np.ndarray, n: int) -> np.ndarray:
    """Mean over the last n time steps, or over as many as there are."""
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - n, 0)
    return (total[last] - total[first]) / (last - first)[:, None]

"""Variables of the maps (acceleration residual as a function of one or two variables): properties of a driver's
situation that its acceleration may depend on, also where no effect of the library describes such a dependence.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.core.effects.dependence import VARIABLES
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.discovery.observe.residuals import Residuals

REACTION_DELAY = 1.0
"""Delay of the variables that describe an earlier observation [s]."""

MEMORY = 10.0
"""Time over which a driver may remember its own speed [s]."""

LONGEST_TIME_GAP = 6.0
"""Upper bound of the time gap; larger ones are set to it [s]."""

FASTEST_APPROACH = 10.0
"""Bound of the approach rates of the second leader and the follower; faster ones are set to it [m/s]."""

DISCRETE = ("lane", "leader_class", "vehicles_beside")
"""Variables with few values."""

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
class Variable:
    """A variable, one of UNITS, with its value in every time step, in its unit."""

    name: str
    values: Float[np.ndarray, "steps pieces"]

    @property
    def unit(self) -> str:
        """Unit of the variable."""
        return UNITS[self.name]

    @property
    def is_discrete(self) -> bool:
        """True if the variable is discrete."""
        return self.name in DISCRETE

    @property
    def title(self) -> str:
        """Readable name of the variable."""
        return title_of(self.name)


def title_of(name: str) -> str:
    """Readable name of a variable."""
    return _TITLES.get(name, name.replace("_", " "))


_TITLES = {
    "approach_rate_before": f"approach rate {REACTION_DELAY:g} s ago",
    "leader_acceleration_before": f"leader's accel. {REACTION_DELAY:g} s ago",
    "leader_acceleration": "leader's acceleration",
    "leader_length": "leader's length",
    "second_gap": "gap to the second leader",
    "second_approach_rate": "approach to the second leader",
    "follower_gap": "follower's gap",
    "follower_approach_rate": "follower's approach",
    "speed_beside": "own speed less the slowest beside",
    "speeds_ahead": "variation of the speeds ahead",
    "past_speed": f"own speed, mean of {MEMORY:g} s",
    "lateral_offset": "offset in the lane, right positive",
    "leader_class": "leader's class, 1 truck",
    "time_since_change": "time since the leader changed",
    "lane": "lane, 0 leftmost",
}


def variables_of(residuals: Residuals) -> dict[str, Variable]:
    """The variables by name, halfway between each time step and the next, where the observer evaluates the model.

    The driver's position and speed there are predicted from earlier measurements: later ones contain the driver's
    noise, so a variable that used them would be correlated with the noise and look like a cause.
    """
    data = residuals.state.data
    stimulus = residuals.stimulus()
    delay = max(1, round(REACTION_DELAY / data.dt))

    def earlier(values: np.ndarray) -> np.ndarray:
        """Values REACTION_DELAY before; at the start of a piece, its first values."""
        return np.concatenate([np.repeat(values[:1], delay, axis=0), values[:-delay]])

    values = {name: np.asarray(VARIABLES[name][1](stimulus), float) for name in VARIABLES if name in UNITS}
    gap, speed = np.asarray(stimulus.gap), np.asarray(stimulus.speed)
    has_second, has_follower = np.asarray(stimulus.has_second), np.asarray(stimulus.has_follower)
    values |= {
        "time_gap": np.clip(gap / np.maximum(speed, 2.0), 0.0, LONGEST_TIME_GAP),
        "approach_rate_before": earlier(values["approach_rate"]),
        "leader_acceleration_before": earlier(values["leader_acceleration"]),
        "second_approach_rate": has_second * _bounded(speed - np.asarray(stimulus.second_speed)),
        "follower_approach_rate": has_follower * _bounded(np.asarray(stimulus.follower_speed) - speed),
        "speeds_ahead": _variation_ahead(stimulus),
        "past_speed": _mean_of_past(speed, max(1, round(MEMORY / data.dt))),
        "lateral_offset": np.asarray(stimulus.lateral_offset),  # signed, because a curve need not be symmetric
        "leader_class": np.asarray(stimulus.leader_is_truck),
    }
    return {name: Variable(name, np.broadcast_to(values[name], data.y.shape)) for name in UNITS}


def _bounded(approach_rate: np.ndarray) -> np.ndarray:
    """Approach rates within FASTEST_APPROACH [m/s]."""
    return np.clip(approach_rate, -FASTEST_APPROACH, FASTEST_APPROACH)


def _variation_ahead(stimulus: Stimulus) -> np.ndarray:
    """Coefficient of variation of the speeds of the three vehicles ahead [-], at most 1; 0 where fewer than two are
    in sight. Without a third vehicle, the speed of the second counts twice.
    """
    speeds = np.stack([stimulus.leader_speed, stimulus.second_speed, stimulus.third_speed])
    variation = speeds.std(axis=0) / np.maximum(speeds.mean(axis=0), 1.0)
    return np.minimum(variation, 1.0) * np.asarray(stimulus.has_leader) * np.asarray(stimulus.has_second)


def _mean_of_past(values: np.ndarray, n: int) -> np.ndarray:
    """Mean over the last n time steps, or over as many as there are."""
    sums = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    stop = np.arange(1, len(values) + 1)
    first = np.maximum(stop - n, 0)
    return (sums[stop] - sums[first]) / (stop - first)[:, None]

"""Candidate influences on lane choice besides the own gain: one or more columns per candidate; side is -1 left, +1
right.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.core.effects.anticipation import PASSING_SPEED
from rearl_jax.discovery.lane_changes.opportunities import Opportunities

Column = Float[np.ndarray, " rows"]

LANE_CHOICE_DEPENDENCE = "lane_choice_dependence"
"""Name of a dependence without a library effect."""

MOST_GAIN = 2.0
"""Bound of accelerations gained or lost [m/s^2], because larger values are mostly measurement error."""

NEAR, PASSED_BY = 80.0, 1.0
"""A driver would pass the leader on its lane if the gap is below NEAR [m] and the leader at most PASSED_BY faster
[m/s].
"""


@dataclass(frozen=True)
class Form:
    """One functional form of a candidate: `column` is the addition to the incentive per unit of the effect's strength,
    `shape` the name, value and unit of the parameters of the effect that are fixed in this form.
    """

    column: Callable[[Opportunities], Column]
    shape: tuple[tuple[str, float, str], ...] = ()


@dataclass(frozen=True)
class LaneCandidate:
    """A possible influence on lane choice.

    Attributes:
        name: Name of the effect in the library, or `lane_choice_dependence`.
        kind: `driver`, or `generic` for a circumstance.
        variables: Variables that it depends on.
        strength: Parameter of the effect that multiplies the column, with its unit.
        low, high: Values the strength may have.
        forms: Functional forms; the best one represents the candidate.
    """

    name: str
    kind: str
    variables: tuple[str, ...]
    strength: tuple[str, str]
    low: float
    high: float
    forms: tuple[Form, ...]

    @property
    def is_circumstance(self) -> bool:
        """Whether every model contains it and it is never named: no library effect, but it may compensate for errors of
        the computed own gain, and longer gaps behind are accepted more often by any driver.
        """
        return self.kind == "generic"

    @property
    def key(self) -> str:
        """Unique name of the candidate."""
        return self.name if self.kind == "driver" else f"{self.name}.{self.variables[0]}"


def own_gain(table: Opportunities) -> Column:
    """Own acceleration gained, bounded [m/s^2]."""
    return np.clip(table.incentive, -MOST_GAIN, MOST_GAIN)


def _politeness(table: Opportunities) -> Column:
    return np.clip(table.rear_gain, -MOST_GAIN, MOST_GAIN) + np.clip(table.follower_gain, -MOST_GAIN, MOST_GAIN)


def _unused_gain(table: Opportunities) -> Column:
    """Minus the own gain on the right lane [m/s^2]: what drivers forgo who do not pass on the right; 0 at low speed."""
    may_not_pass = (table.side > 0) & (table.speed > PASSING_SPEED)
    return -np.where(may_not_pass, np.clip(table.incentive, 0.0, MOST_GAIN), 0.0)


def _undertaking(table: Opportunities) -> Column:
    """-1 m/s^2 for a change to the right if a vehicle near on the own lane would be passed, else 0."""
    passes = (table.gap < NEAR) & (table.leader_speed < table.speed + PASSED_BY) & (table.speed > PASSING_SPEED)
    return -((table.side > 0) & passes).astype(float)


def _pressure(pressing_time_gap: float) -> Callable[[Opportunities], Column]:
    """Pressure from behind to move to the right [-], with the formula of the effect `MovingOver`; it is 0.5 if the
    follower's time gap equals `pressing_time_gap` [s].
    """

    def column(table: Opportunities) -> Column:
        time_gap = np.maximum(table.follower_gap, 0.5) / (np.maximum(table.follower_speed, 0.0) + 2.0)
        excess = np.clip((time_gap - pressing_time_gap) / 0.25, -50.0, 50.0)
        return np.where(table.side > 0, 1.0 / (1.0 + np.exp(excess)), 0.0)

    return column


def _truck(reach: float) -> Callable[[Opportunities], Column]:
    """Term of the effect `TruckAversion` [-]: the truck ahead on the own lane minus that on the adjacent lane, each
    with a weight that decays with its gap over `reach` [m].
    """

    def column(table: Opportunities) -> Column:
        here = table.leader_is_truck * np.exp(-np.maximum(table.gap, 0.0) / reach)
        return here - table.side_leader_is_truck * np.exp(-np.maximum(table.side_gap, 0.0) / reach)

    return column


def _circumstance(variable: str, column: Callable[[Opportunities], Column]) -> LaneCandidate:
    """A dependence on a variable without a library effect; the column is the variable, scaled to about 1 [-]."""
    slope, forms = ("slope", "m/s^2"), (Form(column),)
    return LaneCandidate(LANE_CHOICE_DEPENDENCE, "generic", (variable,), slope, -9.0, 9.0, forms)


CANDIDATES = (
    LaneCandidate("keep_right", "driver", ("side",), ("bias", "m/s^2"), -2.0, 2.0,
                  (Form(lambda table: table.side.astype(float)),)),
    LaneCandidate("politeness", "driver", ("gain_of_others",), ("weight", "-"), 0.0, 2.0, (Form(_politeness),)),
    LaneCandidate("no_passing_on_the_right", "driver", ("side", "leader_speed"), ("weight", "-"), 0.0, 1.0,
                  (Form(_unused_gain), Form(_undertaking))),
    LaneCandidate("moving_over", "driver", ("side", "follower_gap"), ("gain", "m/s^2"), -1.0, 3.0,
                  tuple(Form(_pressure(z), (("pressing_time_gap", z, "s"),)) for z in (0.6, 1.0, 1.5))),
    LaneCandidate("truck_aversion", "driver", ("leader_class",), ("gain", "m/s^2"), -2.0, 3.0,
                  tuple(Form(_truck(reach), (("reach", reach, "m"),)) for reach in (40.0, 80.0, 200.0))),
    LaneCandidate("cooperation", "driver", ("rear_braking",), ("weight", "-"), 0.0, 5.0,
                  (Form(lambda table: np.clip(table.rear_braking, 0.0, MOST_GAIN)),)),
    _circumstance("rear_gap", lambda table: np.clip(table.rear_gap, 0.0, 60.0) / 30.0),
    _circumstance("own_class", lambda table: table.is_truck.astype(float)),
    _circumstance("speed", lambda table: (table.speed - 22.0) / 5.0),
    _circumstance("speed_of_lanes",
                lambda table: np.clip(table.side_leader_speed - table.leader_speed, -8.0, 8.0) / 5.0),
)  # fmt: skip
"""All candidates."""

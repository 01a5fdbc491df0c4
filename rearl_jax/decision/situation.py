"""Input of a policy, and its type: a function from a situation to actions."""

from collections.abc import Callable
from typing import TypeAlias

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int, Key

from rearl_jax.core.rollout import Frames
from rearl_jax.detection.detector import Detection
from rearl_jax.detection.table import ReferenceTable

ACTION_NAMES = ("left", "keep", "right", "faster", "slower")
"""Names of the meta-actions in tables, questions and answers, in the order of `MetaAction`."""

N_ACTIONS = len(ACTION_NAMES)
"""Number of meta-actions."""

NO_ACTION = -1
"""Answer of a policy that has no action for a vehicle. Any number that is not an action is treated alike."""


class Situation(eqx.Module):
    """The traffic at the end of a second, the input of a policy that decides about the next one.

    Attributes:
        second: Index of this second; policies imitate the same second of the reference.
        frame: The traffic.
        target_lane: Lane each vehicle is steered to.
        detection: Result of the detection; its mask marks the vehicles that need a decision.
        admissible: Actions admissible for each vehicle, in the order of `MetaAction`.
        since_lane_change: Time since the last lane change of each vehicle [s]; a large number if none was seen.
        last_action: Action of each vehicle in the previous second, NO_ACTION for none.
    """

    second: Int[Array, ""]
    frame: Frames
    target_lane: Int[Array, "vehicles scenarios"]
    detection: Detection
    admissible: Bool[Array, "actions vehicles scenarios"]
    since_lane_change: Int[Array, "vehicles scenarios"]
    last_action: Int[Array, "vehicles scenarios"]

    @property
    def is_asked(self) -> Bool[Array, "vehicles scenarios"]:
        """Vehicles that need a decision."""
        return self.detection.mask

    @property
    def spacing(self) -> Float[Array, "vehicles scenarios"]:
        """Mean distance of each vehicle to the others [m]."""
        return self.detection.spacing


Policy: TypeAlias = Callable[
    [Situation, ReferenceTable, Key[Array, " scenarios"]],
    Int[Array, "vehicles scenarios"],
]
"""Action of every vehicle, from the situation, the references and one random key per scenario for this second.

Actions of vehicles that need no decision are ignored, and so are inadmissible ones: a policy may return anything there.
"""

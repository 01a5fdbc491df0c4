"""Replayed scenes of a page: one rollout each, and the recorded scene it is compared with."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.config import EvaluateTask
from rearl_jax.core.rollout import Frames
from rearl_jax.data.scenes.boundary import SceneBoundary
from rearl_jax.data.scenes.scene_set import SceneSet


@dataclass(frozen=True)
class Decision:
    """One decision about a vehicle.

    Attributes:
        rollout: Number of the rollout.
        second: Frame at whose end the decision was made; the action is followed in the next second.
        vehicle: Number of the vehicle.
        action: Action of the vehicle, in the order of `MetaAction`; NO_ACTION if the answer cannot be followed.
    """

    rollout: int
    second: int
    vehicle: int
    action: int


@dataclass(frozen=True)
class ReplayedScene:
    """A rollout and the recorded scene it was scored on.

    Attributes:
        index: Index of the scene in the `SceneSet`.
        run: Number of the run.
        frames: The rollout, `[seconds, vehicles]`.
        lengths: Lengths of its vehicles [m].
        h: Hellinger distance of the rollout [-].
        decisions: Decisions about vehicles, with times and actions.
        around: Recorded vehicles around this one scene; None for a free road.
    """

    index: int
    run: int
    frames: Frames
    lengths: Float[np.ndarray, " vehicles"]
    h: float
    decisions: tuple[Decision, ...] = ()
    around: SceneBoundary | None = None


@dataclass(frozen=True)
class Replay:
    """Scenes to be shown.

    Attributes:
        config: The method that was simulated.
        scenes: All recorded scenes.
        replayed: The replayed scenes.
        origin: Description of the origin of the rollouts.
        has_decisions: Whether the method intervenes and the vehicles with decisions are known.
    """

    config: EvaluateTask
    scenes: SceneSet
    replayed: tuple[ReplayedScene, ...]
    origin: str
    has_decisions: bool = False

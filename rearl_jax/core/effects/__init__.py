"""The effect library: what drivers and roads do beyond car following, shared by simulation and discovery."""

from rearl_jax.core.effects.anticipation import Asymmetry, LaneFriction, LeaderAcceleration, SeveralLeaders
from rearl_jax.core.effects.dependence import VARIABLES, Dependence
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.perception import ReactionDelay
from rearl_jax.core.effects.road import Bend, Grade, LaneDesiredSpeed, SpeedLimit, Weather
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.effects.time_gaps import (
    LeaderClass,
    RearPressure,
    Relaxation,
    Resignation,
    SpeedDependentTimeGap,
    VarianceDrivenTimeGap,
)

__all__ = [
    "EFFECTS",
    "VARIABLES",
    "Dependence",
    "Effect",
    "Parameter",
    "Stimulus",
]

EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        ReactionDelay,
        SeveralLeaders,
        LeaderAcceleration,
        SpeedDependentTimeGap,
        VarianceDrivenTimeGap,
        Resignation,
        Relaxation,
        RearPressure,
        LeaderClass,
        Asymmetry,
        LaneFriction,
        LaneDesiredSpeed,
        Grade,
        SpeedLimit,
        Bend,
        Weather,
        Dependence,
    )
}
"""Every effect by its name in model files and verdicts."""

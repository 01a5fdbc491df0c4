"""The effect library: what drivers and roads do beyond car following, shared by simulation and discovery."""

from rearl_jax.core.effects.action_points import ActionPoints
from rearl_jax.core.effects.anticipation import (
    Asymmetry,
    LaneFriction,
    LeaderAcceleration,
    NoUndertaking,
    SeveralLeaders,
)
from rearl_jax.core.effects.cooperation import Cooperation
from rearl_jax.core.effects.dependence import VARIABLES, Dependence, TimeGapDependence
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.lane_changes import KeepRight, MovingOver, NoPassingOnTheRight, Politeness, TruckAversion
from rearl_jax.core.effects.noise import AccelerationNoise, PerceptionNoise
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
        NoUndertaking,
        LaneDesiredSpeed,
        Grade,
        SpeedLimit,
        Bend,
        Weather,
        Dependence,
        TimeGapDependence,
        AccelerationNoise,
        PerceptionNoise,
        ActionPoints,
        KeepRight,
        NoPassingOnTheRight,
        Politeness,
        Cooperation,
        MovingOver,
        TruckAversion,
    )
}
"""Every effect by its name in model files and verdicts."""

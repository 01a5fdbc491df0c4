"""Interface of an effect: driver behaviour in addition to car following, as hooks into the traffic model.

An effect is a record of its parameters and overrides some of the hooks; all other hooks return their input unchanged.
If all strengths have their value `off`, the effect is off. All hooks are element-wise and differentiable.
"""

from dataclasses import dataclass
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.side_lane import SideLane
from rearl_jax.core.effects.stimulus import Stimulus


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name: Field of the effect.
        unit: Unit; "-" for none.
        meaning: Meaning in one line.
        off: For a strength, the value at which the effect is off; for a shape parameter, a typical value.
        low: Lower bound; 0 for a strength whose sign is fixed.
        high: Upper bound.
        scale: Typical distance of values from `off`, the standard deviation of the prior.
        is_strength: Whether the effect is off if this parameter (with the other strengths) is `off`; others only shape
            the effect.
        is_list: Whether it is a list of values, one per knot of a curve.
    """

    name: str
    unit: str
    meaning: str
    off: float
    low: float
    high: float
    scale: float
    is_strength: bool = True
    is_list: bool = False


class Effect(eqx.Module):
    """Base class of effects: every hook returns its input unchanged; no hook depends on the formula of a car-following
    model.

    Class attributes:
        name: Name in model files and verdicts.
        kind: `driver` (car following), `road`, `generic`, `random`, `lane_change`.
        equation: Equation in one line.
        source: Where the equation comes from.
        parameters: Parameters of the effect, in the order of its fields.
        depends_on: Variables that the effect depends on, as in a verdict; discovery only tests effects that state them.
    """

    name: ClassVar[str]
    kind: ClassVar[str] = "driver"
    equation: ClassVar[str]
    source: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    depends_on: ClassVar[tuple[str, ...]] = ()

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> PyTree:
        """Memory at the start; None for an effect without memory."""
        return None

    def remember(self, memory: PyTree, seen: Stimulus, driver: CarFollowing, dt: float) -> PyTree:
        """Memory after this time step of `dt` [s]."""
        return memory

    def perceive(self, seen: Stimulus, memory: PyTree) -> Stimulus:
        """Stimulus as the driver perceives it."""
        return seen

    def desired_speed(self, value: Float[Array, "*n"], seen: Stimulus, memory: PyTree) -> Float[Array, "*n"]:
        """Desired speed v0 [m/s]."""
        return value

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: PyTree) -> Float[Array, "*n"]:
        """Desired time gap T [s]."""
        return value

    def standstill_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: PyTree) -> Float[Array, "*n"]:
        """Gap at standstill s0 [m]."""
        return value

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: PyTree, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Interaction deceleration [m/s^2], positive: by how much the vehicles ahead reduce the free acceleration.

        Args:
            value: Interaction deceleration behind the leader, changed by the effects before this one.
            seen: Stimulus as the driver perceives it.
            memory: Memory of the effect.
            driver: Car following with its present set points; `driver.interaction` is the response to another vehicle.
        """
        return value

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: PyTree) -> Float[Array, "*n"]:
        """Wanted acceleration [m/s^2], before the bounds of the vehicle."""
        return value

    def actuate(self, wanted: Float[Array, "*n"], last: Float[Array, "*n"], dt: float) -> Float[Array, "*n"]:
        """Acceleration that the vehicle executes [m/s^2].

        Args:
            wanted: Acceleration wanted by the driver [m/s^2].
            last: Acceleration executed in the last time step [m/s^2].
            dt: Time step [s].
        """
        return wanted

    def incentive(
        self, value: Float[Array, "*n"], side: SideLane, seen: Stimulus, memory: PyTree
    ) -> Float[Array, "*n"]:
        """Gain of a change to an adjacent lane [m/s^2]; `seen` is the true stimulus on the driver's lane, without
        errors of perception.
        """
        return value

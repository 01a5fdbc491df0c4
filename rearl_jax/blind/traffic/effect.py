"""Base class of hidden effects: hooks into the generator's driving.

An effect that is also in the library of discovery has another functional form there; both are from the literature.
"""

from collections.abc import Mapping

import numpy as np

from rearl_jax.blind.traffic.snapshot import Choice, Snapshot


class HiddenEffect:
    """Base class of hidden effects, without any influence.

    Attributes:
        truths: Correct answers: names of effects, any of which is sufficient.
        variables: Variables that an unlisted effect depends on.
        usual: Parameters that are proportional to the strength, at strength 1.
        parameters: Parameter values with the same meaning in the library, by the library's names.
    """

    truths: tuple[str, ...] = ()
    variables: tuple[str, ...] = ()
    usual: Mapping[str, float] = {}

    def __init__(self, strength: float) -> None:
        self.strength = strength
        self.parameters = {name: value * strength for name, value in self.usual.items()}

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        """Called once, before the first step; `section` is a part of the road that most vehicles pass [m]."""

    def observe(self, now: Snapshot, dt: float) -> None:
        """Called first in every step, to update the memory of the effect."""

    def perceive(self, gap: np.ndarray, dv: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        """Gap [m] and approach rate [m/s] as perceived by the driver."""
        return gap, dv

    def desired_speed(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """Desired speed v0 [m/s]."""
        return value

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """Time gap T [s]."""
        return value

    def interaction(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """Interaction term (s*/s)^2 [-]."""
        return value

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """Acceleration with the effect's contribution added [m/s^2]."""
        return value

    def respond(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """Executed acceleration, from the one that the driver wants now [m/s^2]."""
        return value

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        """Gain of a lane change with the effect's contribution [m/s^2]."""
        return value

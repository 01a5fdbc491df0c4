"""What can be hidden in the drivers and in the road: hooks into the generator's own driving.

Each effect has a functional form of its own, another reading of the literature than the library that is tested with it.
"""

from collections.abc import Mapping

import numpy as np

from rearl_jax.blind.traffic.snapshot import Choice, Snapshot


class HiddenEffect:
    """Base of all: nothing is different.

    Attributes:
        truths: What counts as the right answer: names of effects, of which one is enough.
        variables: For what no list holds: what it depends on.
        usual: Parameters that are proportional to the strength, at strength 1.
        parameters: Values that mean the same in the library, by its names.
    """

    truths: tuple[str, ...] = ()
    variables: tuple[str, ...] = ()
    usual: Mapping[str, float] = {}

    def __init__(self, strength: float) -> None:
        self.strength = strength
        self.parameters = {name: value * strength for name, value in self.usual.items()}

    def begin(self, now: Snapshot, section: tuple[float, float], rng: np.random.Generator) -> None:
        """Called once, before the first step; `section` is the part of the road everybody crosses [m]."""

    def observe(self, now: Snapshot, dt: float) -> None:
        """Called in every step before anything else, for what is remembered."""

    def perceive(self, gap: np.ndarray, dv: np.ndarray, now: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        """Gap [m] and approach rate [m/s] as the driver takes them."""
        return gap, dv

    def desired_speed(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """v0 [m/s]."""
        return value

    def time_gap(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """T [s]."""
        return value

    def interaction(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """(s*/s)^2 [-]."""
        return value

    def acceleration(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """What is added to the model's acceleration is added here [m/s^2]."""
        return value

    def respond(self, value: np.ndarray, now: Snapshot) -> np.ndarray:
        """The acceleration the driver carries out, of the one the driver wants now [m/s^2]."""
        return value

    def gain_of_change(self, value: np.ndarray, choice: Choice, now: Snapshot) -> np.ndarray:
        """What a change of lanes pays [m/s^2]."""
        return value

"""Candidates: all effects that may be missing from the model, with their parameters in one vector, theta.

At the reference value of theta no effect acts. A candidate has some elements of the vector: the directions that the
screen (`search.screen`, a score test) tests at the reference value, and the elements that the full fit (`search.refit`)
estimates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.effect import Effect
from rearl_jax.discovery.observe.curves import CentredCurve, DesiredSpeedCurve, TimeGapCurve
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.early_leader import EarlyLeader
from rearl_jax.discovery.observe.lens import Lens

FLAT = 1e6
"""Standard deviation of an uninformative prior, in the unit of the parameter."""

POSITION_KNOTS, TIME_KNOTS, CURVE_KNOTS, LENS_KNOTS = 17, 7, 5, 21
"""Number of knots of curves over position, over time and over other variables, and of the camera distortion (lens)."""

CANDIDATE_EFFECTS: dict[str, type[Effect]] = {EarlyLeader.name: EarlyLeader} | EFFECTS
"""Effects by name: those of the library, and those that exist only in recordings."""

NAMED = tuple(name for name, effect in CANDIDATE_EFFECTS.items() if effect.depends_on)
"""Effects whose strengths are themselves the directions of the screen."""

PLACED = {"grade": "position", "speed_limit": "position", "weather": "time"}
"""Effects on a section of road, or from some time on, with the variable: the screen tests a curve over it, because the
ends of the section are not known yet; the full fit estimates them.
"""

TWINS = {"speed_limit": ("bend",)}
"""By effect, other effects with the same influence on a follower; trajectories alone cannot distinguish them."""

CURVES = (
    "time",
    "lane",
    "lateral_offset",
    "length",
    "leader_length",
    "time_since_change",
    "vehicles_beside",
    "speed",
    "gap",
    "approach_rate",
    "leader_acceleration",
    "second_gap",
    "follower_gap",
    "speed_beside",
)
"""Variables of `dependence.VARIABLES` that are tested for effects outside the library; `grade` already covers position.
"""

TIME_GAP_CURVES = ("lateral_offset", "leader_length", "vehicles_beside", "time_since_change", "follower_gap")
"""Variables that the time gap may depend on. A variable that hardly changes within a drive is not among them, because
the driver's own parameters take up its influence.
"""

RANGES = {
    "lateral_offset": (0.0, 0.6),
    "length": (4.0, 14.0),
    "leader_length": (4.0, 14.0),
    "time_since_change": (0.0, 20.0),
    "vehicles_beside": (0.0, 4.0),
    "speed_beside": (-10.0, 15.0),
}
"""Outer knots of curves over variables with a known range, in their units; for others the range in the data is used."""


@dataclass(frozen=True)
class Term:
    """Term that may be added to the model: an effect, or a curve over one variable.

    Attributes:
        effect: Name of an effect of the library, or of an artefact.
        variable: Variable of a curve; None for an effect with parameters of its own.
    """

    effect: str
    variable: str | None = None

    @classmethod
    def read(cls, text: str) -> "Term":
        """The term that a file names as `effect` or `effect.variable`."""
        effect, _, variable = text.partition(".")
        return cls(effect, variable or None)

    def __str__(self) -> str:
        """The term as in files: `effect` or `effect.variable`."""
        return self.effect if self.variable is None else f"{self.effect}.{self.variable}"

    @property
    def is_effect(self) -> bool:
        """True if it is an effect with parameters of its own."""
        return self.variable is None and self.effect in CANDIDATE_EFFECTS


ALONG_ROAD = Term("dependence", "position")
"""Acceleration as a curve over position; the screen uses it for grades, whose edges are not known yet."""

EARLY_LEADER = Term("early_leader")
"""Response to the next leader before the lane column shows the lane change."""

LANE_CHANGES = (EARLY_LEADER, Term("relaxation"))
"""Effects of every lane change; the base model contains them, because they would otherwise hide other effects."""

REACTION_DELAY = Term("reaction_delay")
"""Delays of the responses to the vehicle ahead and to the own speed."""

LENS = Term("lens")
"""Distortion of positions by the camera."""

NAMED_KINDS = frozenset({"driver", "road"})
"""Kinds of candidates that are named effects of traffic; the others are free curves and artefacts of the recording."""


@dataclass(frozen=True)
class Candidate:
    """An effect that may be missing.

    Attributes:
        term: The effect or curve.
        kind: `driver` or `road` for a named effect, `generic` for a curve, `artefact` of the recording.
        directions: Indices of theta whose directions the screen tests.
        free: Indices of theta that the refit estimates.
        variables: Variables that it depends on.
    """

    term: Term
    kind: str
    directions: tuple[int, ...]
    free: tuple[int, ...]
    variables: tuple[str, ...]


class Knots(eqx.Module):
    """Knots of the curves, as arrays, so that one program compiled by XLA serves all data.

    Attributes:
        position: Knots along the road [m].
        position_centre: Mean weight of each of them in the data [-].
        time: Knots in time [s].
        time_centre: Mean weight of each of them in the data [-].
        lens: Knots of the camera's distortion [m].
        curve: Knots of the curves over other variables, by variable.
        centre: Mean weight of each knot of these curves in the data [-], by variable.
    """

    position: Float[Any, " position_knots"]
    position_centre: Float[Any, " position_knots"]
    time: Float[Any, " time_knots"]
    time_centre: Float[Any, " time_knots"]
    lens: Float[Any, " lens_knots"]
    curve: dict[str, Float[Any, " curve_knots"]]
    centre: dict[str, Float[Any, " curve_knots"]]


Numbers = dict[str, Float[Array, "knots *#n"]]
"""Elements of theta, by the names of `Layout.places`."""


@dataclass(frozen=True)
class Layout:
    """Layout of theta: the meaning, bounds and prior of each element.

    Attributes:
        candidates: Candidates by term.
        reference: Theta without any acting effect; shape parameters have their default values.
        low, high: Bounds of each element.
        scale: Standard deviation of the prior of each element.
        unit: Step length of the search, near the smallest change with a noticeable influence on the fit.
        places: Indices of theta by name: `effect.parameter`, or the name of a curve.
        knots: Knots of the curves.
        prior: Prior distribution of drivers' parameters.
    """

    candidates: dict[Term, Candidate]
    reference: Float[np.ndarray, " parameters"]
    low: Float[np.ndarray, " parameters"]
    high: Float[np.ndarray, " parameters"]
    scale: Float[np.ndarray, " parameters"]
    unit: Float[np.ndarray, " parameters"]
    places: dict[str, tuple[int, ...]]
    knots: Knots
    prior: Prior

    @property
    def size(self) -> int:
        """Length of theta."""
        return len(self.reference)

    @property
    def blocks(self) -> tuple[tuple[int, ...], ...]:
        """Directions of the candidates, each once."""
        return tuple(sorted({candidate.directions for candidate in self.candidates.values()}))

    def with_values(
        self, theta: Float[np.ndarray, " parameters"], values: Mapping[str, float]
    ) -> Float[np.ndarray, " parameters"]:
        """Theta with new values of some parameters, by the names of `places`, each clipped to its bounds."""
        theta = theta.copy()
        for name, value in values.items():
            place = self.places[name][0]
            theta[place] = np.clip(value, self.low[place], self.high[place])
        return theta

    def by_name(self, theta: Float[Array, "parameters *n"]) -> Numbers:
        """The elements of theta by the names of `places`."""
        return {name: theta[place[0] : place[-1] + 1] for name, place in self.places.items()}

    def at(self, numbers: Numbers, places: Sequence[int]) -> list[Float[Array, "some *n"]]:
        """The elements at indices of theta, in their order; consecutive elements under one name stay together."""
        name_and_offset = {place: (name, k) for name, indices in self.places.items() for k, place in enumerate(indices)}
        runs: list[tuple[str, int, int]] = []  # name, first offset, offset behind the last
        for name, k in (name_and_offset[place] for place in places):
            if runs and runs[-1][0] == name and runs[-1][2] == k:
                runs[-1] = (name, runs[-1][1], k + 1)
            else:
                runs.append((name, k, k + 1))
        return [numbers[name][first:end] for name, first, end in runs]


def effects_at(numbers: Numbers, knots: Knots, active: Sequence[Term] | None = None) -> tuple[Effect, ...]:
    """Effects and curves with the elements of theta as of `Layout.by_name`: those of the active terms, or of all terms
    if these are None, including those that only the screen uses.
    """

    def named(name: str) -> Effect:
        return CANDIDATE_EFFECTS[name](
            *(numbers[f"{name}.{parameter.name}"][0] for parameter in CANDIDATE_EFFECTS[name].parameters)
        )

    def over(variable: str, kind: type[CentredCurve | TimeGapCurve], name: str) -> Effect:
        return kind(numbers[f"{name}.{variable}"], knots.curve[variable], knots.centre[variable], variable)

    along_road = CentredCurve(numbers["position"], knots.position, knots.position_centre, "position")
    if active is None:
        over_time = knots.time, knots.time_centre, "time"
        return (
            *(named(name) for name in (*NAMED, *PLACED)),
            along_road,
            DesiredSpeedCurve(numbers["desired_speed"], knots.position, knots.position_centre, "position"),
            DesiredSpeedCurve(numbers["weather_speed"], *over_time),
            TimeGapCurve(numbers["weather_time_gap"], *over_time),
            *(over(variable, CentredCurve, "curve") for variable in knots.curve),
            *(over(variable, TimeGapCurve, "time_gap") for variable in knots.curve if variable in TIME_GAP_CURVES),
        )
    effects = []
    for term in active:
        if term.is_effect:
            effects.append(named(term.effect))
        elif term == ALONG_ROAD:
            effects.append(along_road)
        elif term.variable is not None:
            kind, name = (CentredCurve, "curve") if term.effect == "dependence" else (TimeGapCurve, "time_gap")
            effects.append(over(term.variable, kind, name))
    return tuple(effects)


def lens_at(numbers: Numbers, knots: Knots) -> Lens:
    """Camera distortion with these elements of theta, as of `Layout.by_name`."""
    return Lens(numbers["lens"], jnp.asarray(knots.lens))

"""Layout of theta (the vector of all candidates' parameters) for a data set: indices, bounds, priors and knots."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.core.effects.dependence import VARIABLES, hat_weights
from rearl_jax.discovery.observe.candidates import (
    ALONG_ROAD,
    CANDIDATE_EFFECTS,
    CURVE_KNOTS,
    CURVES,
    FLAT,
    LENS,
    LENS_KNOTS,
    NAMED,
    PLACED,
    POSITION_KNOTS,
    RANGES,
    TIME_GAP_CURVES,
    TIME_KNOTS,
    Candidate,
    Knots,
    Layout,
    Term,
)
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, Prior
from rearl_jax.discovery.observe.observer import stimulus
from rearl_jax.discovery.read.measured import Measured


def layout_of(data: Measured, prior: Prior = IDM_PRIOR) -> Layout:
    """Layout of theta for these data; its curves span the positions, times and values that occur."""
    used = data.weight > 0
    positions, times = data.y[used], data.surroundings.time[used]
    position_knots = np.linspace(positions.min(), positions.max(), POSITION_KNOTS)
    margin = (positions.max() - positions.min()) / (LENS_KNOTS - 3)
    lens_knots = np.linspace(positions.min() - margin, positions.max() + margin, LENS_KNOTS)
    time_knots = np.linspace(times.min(), times.max(), TIME_KNOTS)
    builder = _Builder()
    for name in NAMED:
        builder.effect(name)
    for name in PLACED:
        builder.parameters(name)
    # Prior standard deviations: of curves of the acceleration in m/s^2, of curves of log v0 and log T without unit.
    along_road = builder.curve("position", POSITION_KNOTS, 0.3)
    of_limit = builder.curve("desired_speed", POSITION_KNOTS, 0.25)
    of_weather = builder.curve("weather_speed", TIME_KNOTS, 0.2) + builder.curve("weather_time_gap", TIME_KNOTS, 0.2)
    builder.candidate(Term("grade"), "road", along_road, builder.all_of("grade"), ("position",))
    builder.candidate(Term("speed_limit"), "road", of_limit, builder.all_of("speed_limit"), ("position",))
    builder.candidate(Term("weather"), "road", of_weather, builder.all_of("weather"), ("time",))
    builder.candidate(ALONG_ROAD, "generic", along_road, along_road, ("position",))
    knots, centres = {}, {}
    for variable in CURVES:
        values = curve_values(data, variable)[used]
        low, high = RANGES.get(variable, tuple(np.quantile(values, [0.02, 0.98])))
        if variable == "time":
            low, high = times.min(), times.max()
        if not values.max() - values.min() > 1e-6 or not high - low > 1e-6:
            continue  # the data show no influence of a variable that is constant
        knots[variable] = np.linspace(low, high, CURVE_KNOTS)
        centres[variable] = _mean_weights(values, knots[variable])
        of_curve = builder.curve(f"curve.{variable}", CURVE_KNOTS, 0.3)
        builder.candidate(Term("dependence", variable), "generic", of_curve, of_curve, (variable,))
        if variable in TIME_GAP_CURVES:
            of_curve = builder.curve(f"time_gap.{variable}", CURVE_KNOTS, 0.3)
            builder.candidate(Term("time_gap_dependence", variable), "generic", of_curve, of_curve, (variable,))
    of_lens = builder.curve("lens", LENS_KNOTS, 2.0)  # [m]
    if data.fused_errors is None:  # else every vehicle measures its own position, and no camera can distort it
        builder.candidate(LENS, "artefact", of_lens, of_lens, ("position",))
    low, high, off, scale, unit = (np.array(column) for column in zip(*builder.rows, strict=True))
    return Layout(
        candidates=builder.candidates,
        reference=off,
        low=low,
        high=high,
        scale=scale,
        unit=unit,
        places=builder.places,
        knots=Knots(
            position=position_knots,
            position_centre=_mean_weights(positions, position_knots),
            time=time_knots,
            time_centre=_mean_weights(times, time_knots),
            lens=lens_knots,
            curve=knots,
            centre=centres,
        ),
        prior=prior,
    )


def _mean_weights(
    values: Float[np.ndarray, " values"], knots: Float[np.ndarray, " knots"]
) -> Float[np.ndarray, " knots"]:
    """Mean weight of each knot of a curve in the data [-]."""
    return np.asarray(hat_weights(jnp.asarray(values), jnp.asarray(knots))).mean(axis=1)


class _Builder:
    """Assigns the elements of theta one after the other.

    Attributes:
        rows: Lower bound, upper bound, reference value, prior standard deviation and step length of each element.
        places: Indices of theta by name, as in `Layout`.
        candidates: Candidates by term.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[float, float, float, float, float]] = []
        self.places: dict[str, tuple[int, ...]] = {}
        self.candidates: dict[Term, Candidate] = {}

    def parameters(self, name: str) -> None:
        """Adds the parameters of an effect."""
        for parameter in CANDIDATE_EFFECTS[name].parameters:
            self.places[f"{name}.{parameter.name}"] = (len(self.rows),)
            prior, step = parameter.scale, parameter.scale
            if parameter.name in _UNKNOWN:
                prior, step = FLAT, _STEPS.get(parameter.unit, parameter.scale)
            self.rows.append((parameter.low, parameter.high, parameter.off, prior, step))

    def effect(self, name: str) -> None:
        """Adds an effect whose strengths are the screen's directions."""
        self.parameters(name)
        effect, free = CANDIDATE_EFFECTS[name], self.all_of(name)
        directions = tuple(place for each, place in zip(effect.parameters, free, strict=True) if each.is_strength)
        self.candidate(Term(name), effect.kind, directions, free, effect.depends_on)

    def all_of(self, name: str) -> tuple[int, ...]:
        """Indices of all parameters of an effect."""
        return tuple(self.places[f"{name}.{parameter.name}"][0] for parameter in CANDIDATE_EFFECTS[name].parameters)

    def curve(self, name: str, n_knots: int, scale: float) -> tuple[int, ...]:
        """Adds the values of a curve, and returns their indices; `scale` is their prior standard deviation and the step
        length of the search.
        """
        self.places[name] = tuple(range(len(self.rows), len(self.rows) + n_knots))
        self.rows += [(-20.0, 20.0, 0.0, scale, scale)] * n_knots
        return self.places[name]

    def candidate(
        self, term: Term, kind: str, directions: tuple[int, ...], free: tuple[int, ...], variables: tuple[str, ...]
    ) -> None:
        """Adds a candidate."""
        self.candidates[term] = Candidate(term, kind, directions, free, variables)


_UNKNOWN = ("start", "end", "onset", "limit", "lateral_acceleration")
"""Parameters with an uninformative prior: nothing is known about the place, time or limit of a section beforehand."""

_STEPS = {"m": 50.0, "s": 5.0, "m/s": 3.0, "m/s^2": 1.0}
"""Step length of the search for parameters with an uninformative prior, by unit."""


def curve_values(data: Measured, variable: str) -> Float[np.ndarray, "steps pieces"]:
    """Measured values of a variable in every time step."""
    seen = stimulus(data.smooth, data.smooth_speed, data.length, data.is_truck.astype(float), data.surroundings)
    values = np.asarray(VARIABLES[variable][1](seen), float)
    return np.broadcast_to(values, data.y.shape)

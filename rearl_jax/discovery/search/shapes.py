"""Shape of a curve (a map of the acceleration residual over one variable) in words: kind, size and range."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.forcing import DriverScores
from rearl_jax.discovery.observe.uncertainty import LOG_OBSERVATIONS
from rearl_jax.discovery.search.maps import Curve, fitted

PENALTY = 0.5 * LOG_OBSERVATIONS
"""Complexity penalty per parameter of a shape [nats], as for a parameter of a candidate."""


@dataclass(frozen=True)
class Shape:
    """A simple shape that approximates a curve.

    Attributes:
        kind: `flat`, `line`, `step`, `bump` or `curve`.
        size: Change from one end to the other, from one side of the step to the other, or inside the bump [m/s^2].
        start, end: Range of the change, in the unit of the variable; equal for a step.
    """

    kind: str
    size: float
    start: float
    end: float


def shape_of(curve: Curve, scores: DriverScores) -> Shape:
    """The shape with the largest gain less complexity penalty; `scores` are those of the knots on the innovations."""
    knots, n = curve.basis.knots, len(curve.basis.knots)
    middle = (knots[1:] + knots[:-1]) / 2
    ends = (float(knots[0]), float(knots[-1]))
    tried = [(0.0, Shape("flat", 0.0, *ends))]  # gain less penalty [nats], and shape
    slope, gain = _scaled((knots - knots.mean()) / np.ptp(knots), scores)
    tried.append((gain - PENALTY, Shape("line", slope, *ends)))
    for k in range(1, n):
        edge = float(middle[k - 1])
        size, gain = _scaled((np.arange(n) >= k).astype(float), scores)
        tried.append((gain - 2 * PENALTY, Shape("step", size, edge, edge)))
        for last in range(k + 1, n):
            size, gain = _scaled(((np.arange(n) >= k) & (np.arange(n) < last)).astype(float), scores)
            tried.append((gain - 3 * PENALTY, Shape("bump", size, edge, float(middle[last - 1]))))
    free = fitted(scores)
    gain = float(free @ scores.score.sum(axis=0) - 0.5 * free @ scores.gram.sum(axis=0) @ free) / scores.variance
    low, high = sorted((float(knots[curve.value.argmin()]), float(knots[curve.value.argmax()])))
    tried.append((gain - n * PENALTY, Shape("curve", curve.reach, low, high)))
    return max(tried, key=lambda item: item[0])[1]


def _scaled(form: Float[np.ndarray, " knots"], scores: DriverScores) -> tuple[float, float]:
    """Best size [m/s^2] of a form, whose values at the knots are given for size 1 [-], and its gain [nats]."""
    score, square = float(form @ scores.score.sum(axis=0)), float(form @ scores.gram.sum(axis=0) @ form)
    size = score / max(square, 1e-12)
    return size, 0.5 * score * size / scores.variance


def shape_words(curve: Curve, shape: Shape) -> str:
    """The shape as a phrase, as in `falls by 0.31 m/s^2 from 2 to 14 m`."""
    unit = "" if curve.basis.variable.unit == "-" else f" {curve.basis.variable.unit}"
    size = f"{abs(shape.size):.2f} m/s^2"
    is_up = shape.size > 0
    if shape.kind == "flat":
        return "does not change"
    if shape.kind == "line":
        return f"{'rises' if is_up else 'falls'} by {size} from {shape.start:.3g} to {shape.end:.3g}{unit}"
    if shape.kind == "step":
        return f"steps {'up' if is_up else 'down'} by {size} at about {shape.start:.3g}{unit}"
    if shape.kind == "bump":
        level = "higher" if is_up else "lower"
        return f"is {level} by {size} between about {shape.start:.3g} and {shape.end:.3g}{unit}"
    knots, value = curve.basis.knots, curve.value
    return (
        f"varies by {size}, lowest at about {knots[value.argmin()]:.3g}{unit}, "
        f"highest at about {knots[value.argmax()]:.3g}{unit}"
    )
